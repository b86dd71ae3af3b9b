"""Measures one row: run in a peer's environment, where little else is installed.

    python -P worker.py MAKE SETTINGS SECONDS

MAKE is a function below that prepares the row and returns its `chunk`: it goes on for some steps
and says how many it made. The last line that is printed is JSON, of the steps and the seconds.
"""

# pyright: reportMissingImports=false
import importlib
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Chunk = Callable[[], int]

ACTIONS, BATCHES = 256, 16
"""Actions of one environment, and batches of actions, drawn beforehand and used over and over."""

PERIOD_S, PRESSURE_PA = 0.01, 350e3
"""How long a command of the plant alone is held, and the gauge pressure of its trial."""


def measured(chunk: Chunk, seconds: float) -> tuple[int, float]:
    """Steps in a time (s), in whole chunks after a first that does not count, and how long."""
    chunk()
    steps, start = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - start) < seconds or not steps:
        steps += chunk()
    return steps, elapsed


def single(environment: Any, actions: Sequence[Any]) -> Chunk:  # noqa: ANN401
    """Steps of one Gymnasium environment; what its resets take counts too."""
    step, reset = environment.step, environment.reset
    reset(seed=0)

    def chunk() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                reset()
        return len(actions)

    return chunk


def many(environment: Any, batches: Iterable[Any], count: int) -> Chunk:  # noqa: ANN401
    """Steps of a vector environment that resets its environments itself."""
    step, following = environment.step, itertools.cycle(batches)
    environment.reset()
    rounds = max(1, 1024 // count)

    def chunk() -> int:
        for _ in range(rounds):
            step(next(following))
        return rounds * count

    return chunk


def sampled(environment: Any, count: int) -> list[Any]:  # noqa: ANN401
    """Actions of an environment's space."""
    environment.action_space.seed(0)
    return [environment.action_space.sample() for _ in range(count)]


def one(name: str, library: str = "gymnasium", **options: Any) -> Chunk:
    """An environment as its library's `make` gives it."""
    environment = importlib.import_module(library).make(name, **options)
    return single(environment, sampled(environment, ACTIONS))


def vector(name: str, count: int, mode: str = "vector_entry_point", **options: Any) -> Chunk:
    """Many of them as `gym.make_vec` gives them: as one array, or one after the other."""
    import gymnasium as gym

    environment = gym.make_vec(name, num_envs=count, vectorization_mode=mode, **options)
    return many(environment, sampled(environment, BATCHES), count)


def dm_control() -> Chunk:
    """A task of DeepMind's control suite, begun anew when its episode ends."""
    # Nothing is drawn, and the machine may have no screen.
    os.environ.setdefault("MUJOCO_GL", "disabled")
    from dm_control import suite

    environment = suite.load("pendulum", "swingup", task_kwargs={"random": 0})
    limits = environment.action_spec()
    shape = (ACTIONS, *limits.shape)
    actions = np.random.default_rng(0).uniform(limits.minimum, limits.maximum, shape)
    environment.reset()

    def chunk() -> int:
        for action in actions:
            if environment.step(action).last():
                environment.reset()
        return len(actions)

    return chunk


def reactor() -> Chunk:
    """PC-gym's stirred tank reactor as its documentation sets it up: minutes, mol/l, K."""
    from pcgym import make_env

    environment = make_env(
        {
            "model": "cstr",
            "integration_method": "casadi",
            "N": 120,
            "tsim": 26,
            "SP": {"Ca": [0.85] * 60 + [0.9] * 60},
            "o_space": {"low": np.array([0.7, 300, 0.8]), "high": np.array([1.0, 350, 0.9])},
            "a_space": {"low": np.array([295.0]), "high": np.array([302.0])},
            "x0": np.array([0.8, 330.0, 0.8]),
        }
    )
    return single(environment, list(np.random.default_rng(0).uniform(-1.0, 1.0, (ACTIONS, 1))))


def envpool(name: str, count: int) -> Chunk:
    """EnvPool's batch on one thread, kept with Python's on one processor, where it is fastest."""
    import envpool as library

    _keep_one_processor()
    environment = library.make(
        name, env_type="gymnasium", num_envs=count, batch_size=count, num_threads=1, seed=0
    )
    space, generator = environment.action_space, np.random.default_rng(0)
    if hasattr(space, "n"):
        batches = generator.integers(space.n, size=(BATCHES, count), dtype=np.int32)
    else:
        shape = (BATCHES, count, *space.shape)
        batches = generator.uniform(space.low, space.high, shape).astype(np.float32)
    return many(environment, batches, count)


def gymnax(name: str, count: int) -> Chunk:
    """A compiled loop in JAX over steps that reset what has ended, on one thread."""
    _keep_one_processor()
    import gymnax as library
    import jax

    jax.config.update("jax_default_prng_impl", "unsafe_rbg")
    environment, parameters = library.make(name)
    length = min(1000, max(4, (1 << 20) // count))
    keys = jax.random.split(jax.random.key(0), (length, count))
    actions = jax.vmap(jax.vmap(environment.action_space(parameters).sample))(keys)
    _, state = jax.vmap(environment.reset, (0, None))(keys[0], parameters)
    stepped = jax.vmap(environment.step, (0, 0, 0, None))

    @jax.jit
    def run(state, keys, actions):  # noqa: ANN001, ANN202 - JAX's own trees
        def one(state, inputs):  # noqa: ANN001, ANN202
            key, action = inputs
            observation, state, reward, *ends, _ = stepped(key, state, action, parameters)
            return state, (observation, reward, ends)

        return jax.lax.scan(one, state, (keys, actions))

    def chunk() -> int:
        nonlocal state
        state, seen = run(state, keys, actions)
        jax.block_until_ready(seen)
        return length * count

    return chunk


def _keep_one_processor() -> None:
    """Threads share one processor, where the system lets a program choose."""
    if sys.platform == "linux":
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def solve_ivp(method: str, rtol: float) -> Chunk:
    """Scipy's integrators on pma-gym's plant under random voltages, called for every control step.

    The right-hand side is compiled.
    """
    import scipy.integrate

    from pma_gym.plant.plant import Plant

    plant = Plant("station")
    rest, regulator = plant.settle(0.0, PRESSURE_PA), plant.regulator_voltage(PRESSURE_PA)
    voltages = np.random.default_rng(0).uniform(0.0, 10.0, 500).tolist()

    def chunk() -> int:
        state = rest.state
        for motor in voltages:
            state = scipy.integrate.solve_ivp(
                lambda _, y, motor=motor: plant.derivative(
                    y, motor, regulator, rest.zero_contraction
                ),
                (0.0, PERIOD_S),
                state,
                method,
                rtol=rtol,
                atol=1e-3 * rtol,
            ).y[:, -1]
        return len(voltages)

    return chunk


def rollouts(name: str, count: int, **options: Any) -> Chunk:
    """PPO's rollouts without its learning: environments, policy, buffer, advantages."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    from pma_gym.sb3 import SB3VecEnv

    torch.set_num_threads(1)
    own = name.startswith("pma_gym/")
    envs = SB3VecEnv(count, name) if own else make_vec_env(name, count, seed=0)
    model: Any = PPO("MlpPolicy", envs, seed=0, device="cpu", **options)
    _, callback = model._setup_learn(total_timesteps=1 << 40)

    def chunk() -> int:
        model.collect_rollouts(model.env, callback, model.rollout_buffer, model.n_steps)
        return model.n_steps * count

    return chunk


if __name__ == "__main__":
    # Where this project is not installed, its own rows are not asked for.
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    make, settings, seconds = sys.argv[1:]
    asked = json.loads(settings)
    if str(asked.get("name", "")).startswith("pma_gym/"):
        import pma_gym  # Registers the environments.

        if effects := asked.pop("effects", None):
            asked["model"] = pma_gym.load_model(asked["model"]).with_effects(effects)
    steps, elapsed = measured(globals()[make](**asked), float(seconds))
    print("\n" + json.dumps({"steps": steps, "seconds": elapsed}))
