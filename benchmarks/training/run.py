"""One training, leg by leg: a leg depends only on the checkpoint before it.

Every leg begins with fresh episodes and seeds of its own, made from the training's seed and the
leg's number. So a training that was killed goes on from its last checkpoint to the same result.
"""

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed

from benchmarks.training.averaging import WeightAverage, averaged, set_weights
from benchmarks.training.checkpoint import load_checkpoint, save_checkpoint
from benchmarks.training.configuration.preset import Preset
from benchmarks.training.environments import (
    drawing_s,
    training_environments,
    validation_environments,
)
from benchmarks.training.learner import learner
from benchmarks.training.validation import Validation, validate
from pma_gym.document_shape import ListOf, Real

MOST_LEGS = 8
"""Most checkpoints of a training."""

EPISODES = 4
"""Fewest episodes that an environment has in a leg."""

EVALUATIONS = 10
"""How often a policy is validated while it learns."""

WORTH = 0.99
"""Factor on the best error so far that counts as progress."""


class Point(NamedTuple):
    """A place on the learning curve.

    Attributes:
        steps: control steps so far.
        wall_s: wall time so far, validation included (s).
        error: of the validation (mm or deg).
        broken: validation episodes that broke a limit.
        reward: mean reward of a validation episode.
        mean: mean error of all validation episodes (mm or deg).
    """

    steps: int
    wall_s: float
    error: float
    broken: int
    reward: float
    mean: float


@dataclass(frozen=True)
class Order:
    """Request for a training.

    Attributes:
        preset: with what.
        seed: of everything random in it.
        device: of PyTorch.
        threads: of PyTorch and of the environments.
        patience: validations without progress after which it ends; 0 for never.
    """

    preset: Preset
    seed: int
    device: str = "cpu"
    threads: int = 1
    patience: int = 0

    def to_json(self) -> dict[str, Any]:
        """All of it that moves the result."""
        return self.preset.to_json() | {
            "seed": self.seed,
            "device": self.device,
            "threads": self.threads,
            "patience": self.patience,
        }


@dataclass
class Course:
    """Progress of a training.

    Attributes:
        curve: validations so far.
        legs: legs that are done.
        wall_s: wall time of these, and of drawing stations (s).
        learning_s: the same without validations and drawing (s).
        stopped: whether it ended at a plateau.
    """

    curve: list[Point] = field(default_factory=list)
    legs: int = 0
    wall_s: float = 0.0
    learning_s: float = 0.0
    stopped: bool = False


class Trained(NamedTuple):
    """Result of a training.

    Attributes:
        model: with its averaged weights.
        course: curve and wall time.
        final: its last validation.
    """

    model: BaseAlgorithm
    course: Course
    final: Validation


OnProgress = Callable[[int, Point | None], None]
"""Is told of progress: control steps so far, and a validation if there was one."""


def leg_ends(preset: Preset, length: int) -> list[int]:
    """Control steps at which legs end.

    Args:
        preset: what is trained.
        length: control steps of an episode.
    """
    legs = preset.steps // (preset.environments * length * EPISODES)
    legs = max(1, min(MOST_LEGS, legs))
    return [round(preset.steps * (k + 1) / legs) for k in range(legs)]


def leg_seed(seed: int, leg: int) -> int:
    """Seed of everything random in a leg; small enough that those of the environments count up."""
    return int(np.random.SeedSequence([seed, leg]).generate_state(1)[0]) >> 2


def train(order: Order, out: Path, on_progress: OnProgress) -> Trained:
    """Train a policy, or go on with a training that was interrupted.

    Args:
        order: what is to be trained.
        out: folder of its checkpoints and logs.
        on_progress: called with the progress.
    Raises:
        PresetError: a device that is absent.
        CheckpointError: a checkpoint of another training, a damaged one, or one that cannot be
            saved.
    """
    preset = order.preset
    torch.set_num_threads(order.threads)
    with (
        closing(training_environments(preset, order.threads)) as envs,
        closing(validation_environments(preset, order.threads)) as checks,
        closing(configure(str(out / "log"), _formats())) as log,
    ):
        model = learner(preset, envs, leg_seed(order.seed, 0), order.device)
        model.set_logger(log)
        average = None
        if preset.average_share:
            average = WeightAverage(preset.average_share, preset.steps)
        course = _resumed(order, out, model, average)
        course.wall_s += drawing_s(preset)
        ends = leg_ends(preset, int(envs.envs.task.steps(preset.rate_hz)))  # type: ignore[attr-defined]
        while course.legs < len(ends) and not course.stopped:
            _leg(order, ends[course.legs], model, average, course, checks, on_progress)
            content = {"order": order.to_json()} | _as_json(course)
            save_checkpoint(out / "checkpoints", course.legs, model, average, content)
        if average is not None and average.weights is not None:
            set_weights(model, average.weights)
        final = validate(model, checks, preset.task)
    return Trained(model, course, final)


def _formats() -> list[str]:
    try:
        import tensorboard  # noqa: F401
    except ImportError:
        return ["csv"]
    return ["csv", "tensorboard"]


_CONTENT = {
    "curve": ListOf(ListOf(Real(finite=False), len(Point._fields))),
    "wall_s": Real(),
    "learning_s": Real(),
    "stopped": bool,
}
"""Shape of what a checkpoint says of its training."""


def _resumed(
    order: Order, out: Path, model: BaseAlgorithm, average: WeightAverage | None
) -> Course:
    """Where the training stands, with the model put there."""
    loaded = load_checkpoint(out / "checkpoints", model, average, _CONTENT, order.to_json())
    if loaded is None:
        return Course()
    legs, content = loaded
    curve = [Point(*point) for point in content["curve"]]
    return Course(curve, legs, content["wall_s"], content["learning_s"], content["stopped"])


def _as_json(course: Course) -> dict[str, Any]:
    return {name: getattr(course, name) for name in ("curve", "wall_s", "learning_s", "stopped")}


def _leg(
    order: Order,
    end: int,
    model: BaseAlgorithm,
    average: WeightAverage | None,
    course: Course,
    checks: Any,  # noqa: ANN401
    on_progress: OnProgress,
) -> None:
    """Train to a number of control steps."""
    began = time.perf_counter()
    seed = leg_seed(order.seed, course.legs)
    set_random_seed(seed)
    model.set_random_seed(seed)
    # Fresh episodes: `learn` resets the environments where there is no last observation.
    model._last_obs = None
    watch = _Watch(order, average, course, checks, on_progress, began)
    callbacks = CallbackList([one for one in (average, watch) if one is not None])
    model.learn(end - model.num_timesteps, callback=callbacks, reset_num_timesteps=False)
    watch.validate_at_end()
    spent = time.perf_counter() - began
    course.legs += 1
    course.wall_s += spent
    course.learning_s += spent - watch.validating_s


class _Watch(BaseCallback):
    """Validates, tells of progress, ends at a plateau."""

    def __init__(
        self,
        order: Order,
        average: WeightAverage | None,
        course: Course,
        checks: Any,  # noqa: ANN401
        on_progress: OnProgress,
        began: float,
    ) -> None:
        super().__init__()
        self._order, self._average, self._course = order, average, course
        self._checks, self._on_progress, self._began = checks, on_progress, began
        self.validating_s = 0.0

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._validate()
        self._on_progress(self.num_timesteps, None)

    @property
    def _next(self) -> float:
        done = self._course.curve[-1].steps if self._course.curve else -1
        return done + self._order.preset.steps / EVALUATIONS if done >= 0 else 0

    def _on_step(self) -> bool:
        return not self._course.stopped

    def validate_at_end(self) -> None:
        """A leg ends with a validation, unless it has just had one."""
        curve = self._course.curve
        if self._course.stopped:
            return
        if not curve or self.model.num_timesteps > curve[-1].steps:
            self._validate()

    def _validate(self) -> None:
        started = time.perf_counter()
        with averaged(self.model, self._average):
            validation = validate(self.model, self._checks, self._order.preset.task)
        self.validating_s += time.perf_counter() - started
        wall = self._course.wall_s + time.perf_counter() - self._began
        point = Point(self.model.num_timesteps, round(wall, 3), *validation)
        curve = self._course.curve
        curve.append(point)
        errors = [one.error for one in curve]
        best = min(range(len(errors)), key=lambda i: (errors[i] > WORTH * min(errors), i))
        patience = self._order.patience
        self._course.stopped = bool(patience) and len(errors) - 1 - best >= patience
        self._on_progress(point.steps, point)
