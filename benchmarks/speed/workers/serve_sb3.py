"""PPO of Stable-Baselines3: collecting rollouts alone, and learning from end to end.

PyTorch gets the threads that are fastest for a row: for minibatches of 64 a second one gains
nothing, and costs ten times the speed where another program wants its core.
"""

# pyright: reportMissingImports=false
import importlib
from contextlib import suppress
from typing import Any

import gymnasium as gym
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.speed.loops import Missing, Prepared
from pma_gym.envs import ENVIRONMENTS

PACKAGES = ("stable_baselines3", "torch", "gymnasium", "numpy")


def copies(name: str, count: int) -> VecEnv:
    """Copies of an environment one after the other, as SB3's own helper makes them."""
    return make_vec_env(name, count, seed=0)


def batch(name: str, count: int) -> VecEnv:
    """This package's vector environment behind SB3's interface."""
    if gym.spec(name).vector_entry_point is None:
        raise Missing("this version has no vector environment")
    return _own("SB3VecEnv", "pma_gym.sb3", "pma_gym.envs.sb3")(count, ENVIRONMENTS[name])


def _own(name: str, *modules: str) -> Any:  # noqa: ANN401 - a class of the version at hand
    """A class of the first module that this version of the package has."""
    for module in modules:
        with suppress(ImportError):
            return getattr(importlib.import_module(module), name)
    raise Missing(f"this version has no {name} in {' or '.join(modules)}")


KINDS = {"copies": copies, "batch": batch}


def learner(name: str, count: int, kind: str, lean: bool = False, **options: Any) -> PPO:
    """PPO that has learned nothing yet; see `rollouts`."""
    make = _own("LeanPPO", "pma_gym.sb3", "pma_gym.envs.sb3_ppo") if lean else PPO
    return make("MlpPolicy", KINDS[kind](name, count), seed=0, device="cpu", **options)


def rollouts(name: str, count: int, kind: str, threads: int = 1, **options: Any) -> Prepared:
    """PPO's rollouts without its learning: environments, policy, buffer, advantages.

    Args:
        name: environment.
        count: how many.
        kind: `copies` or `batch`.
        threads: threads of PyTorch.
        options: `lean` for this package's LeanPPO, and keyword arguments of PPO.
    """
    model = learner(name, count, kind, **options)
    _, callback = model._setup_learn(total_timesteps=1 << 40)

    def chunk() -> int:
        torch.set_num_threads(threads)
        assert model.env is not None
        model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
        return model.n_steps * count

    return Prepared(chunk)


def learning(name: str, count: int, kind: str, threads: int = 1, **options: Any) -> Prepared:
    """PPO from end to end, a rollout and what is learned from it at a time; see `rollouts`."""
    model = learner(name, count, kind, **options)

    def chunk() -> int:
        torch.set_num_threads(threads)
        model.learn(total_timesteps=model.n_steps * count, reset_num_timesteps=False)
        return model.n_steps * count

    return Prepared(chunk)


ROWS = {"rollouts": rollouts, "learning": learning}
