"""A small policy for any rig: trained by PPO, kept as weights, scored as a controller."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.utils import LinearSchedule

from benchmarks.files import write_text
from controllers.rigs import RigController, RigMeasurement
from pma_gym.envs import RigEnv, RigInfo
from pma_gym.sb3 import SB3RigVecEnv
from pma_gym.tasks import KINDS
from pma_gym.tasks.unseen import SEEDS

SEES: dict[str, Any] = {"preview": 8, "history": 3}
"""Options of the environment that a policy is trained and used with."""

ENVIRONMENTS, PARTS, STEPS = 64, 10, 1_000_000
"""Environments at once, parts of a training after each of which it is saved, control steps."""

LEARNING_RATE = 1e-3
"""At the beginning of a training."""

NETWORK: dict[str, Any] = {"net_arch": [64, 64], "log_std_init": -1.0}
"""Of a policy."""

SETTINGS: dict[str, Any] = {
    "n_steps": 64,
    "batch_size": 1024,
    "n_epochs": 8,
    "gamma": 0.97,
    "learning_rate": LEARNING_RATE,
    "policy_kwargs": NETWORK,
    "device": "cpu",
}
"""Of PPO (assumption: found to train on a pendulum within minutes)."""


@dataclass(frozen=True)
class AnyReference:
    """Draws a reference of any kind for a signal.

    Attributes:
        signal: what is to follow.
    """

    signal: str

    def __call__(self, generator: np.random.Generator) -> str:
        """Name of a task."""
        kind = list(KINDS)[generator.integers(len(KINDS))]
        return f"{self.signal}_{kind}_{generator.integers(1, SEEDS)}"


def train(
    options: Mapping[str, Any],
    signal: str,
    file: Path,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    steps: int = STEPS,
    seed: int = 0,
    reference: Callable[[np.random.Generator], str] | None = None,
) -> None:
    """Train a policy, or go on with a training that was interrupted.

    Args:
        options: of the environment, whose randomisation makes the policy robust.
        signal: what is to follow.
        file: where the policy is kept, `.zip`; how far it is stands beside it, `.json`.
        on_progress: called with the control steps made and their number.
        steps: control steps in all.
        seed: of everything random.
        reference: draws the name of an episode's task; of any kind if not given.
    """
    progress = file.with_suffix(".json")
    with closing(
        SB3RigVecEnv(
            ENVIRONMENTS, f"{signal}_steps", reference=reference or AnyReference(signal),
            reward_scale=0.02, **{**options, **SEES},
        )
    ) as envs:  # fmt: skip
        envs.seed(seed)
        torch.set_num_threads(1)
        model = PPO("MlpPolicy", envs, seed=seed, **SETTINGS)
        if progress.exists() and file.exists():
            model.num_timesteps = int(json.loads(progress.read_text())["steps"])
            model.set_parameters(load_from_zip_file(file, load_data=False)[1])
        while model.num_timesteps < steps:
            left = steps - model.num_timesteps
            # The learning rate falls over the whole training, wherever it was interrupted.
            rate = LEARNING_RATE * max(left / steps, 0.02)
            model.lr_schedule = LinearSchedule(rate, rate, 1.0)
            model.learn(min(left, steps // PARTS), reset_num_timesteps=False)
            file.parent.mkdir(parents=True, exist_ok=True)
            model.save(file)
            write_text(progress, json.dumps({"steps": model.num_timesteps}) + "\n")
            on_progress(min(model.num_timesteps, steps), steps)


class RigPolicy(RigController):
    """A trained policy, which acts on what it sees; nothing of its file executes.

    Args:
        file: of the policy.
        options: of the environment, which give the sizes of its network.
    """

    name = "policy"

    def __init__(self, file: Path, options: Mapping[str, Any]) -> None:
        """Read the weights."""
        env = RigEnv(**{**options, **SEES})
        spaces = env.observation_space, env.action_space
        self._policy = ActorCriticPolicy(*spaces, lambda _: LEARNING_RATE, **NETWORK)
        _, weights, _ = load_from_zip_file(file, load_data=False)
        self._policy.load_state_dict(weights["policy"])  # type: ignore[arg-type]
        self._policy.set_training_mode(False)

    def reset(self, info: RigInfo) -> None:
        """Remember the limits of the commands."""
        self._low, self._high = np.array([command.limits for command in info.commands]).T

    def act(self, measurement: RigMeasurement) -> Sequence[float]:
        """Commands (SI)."""
        action, _ = self._policy.predict(measurement.observation, deterministic=True)
        share = 0.5 * (np.clip(action, -1.0, 1.0) + 1.0)
        return (self._low + share * (self._high - self._low)).tolist()
