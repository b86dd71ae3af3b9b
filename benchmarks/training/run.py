"""One training: Stable-Baselines3 learns, and its policy is validated ten times on the way.

Averages a policy's weights while it is trained: what exploration leaves restless evens out.
"""

import ast
import io
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import configure
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.files import reason
from benchmarks.training.policy_batch import (
    Point,
    training_environments,
    validate,
    validation_environments,
)
from benchmarks.training.preset import Preset, PresetError
from pma_gym.documents import parse_json
from pma_gym.files import replace_files

SPANS = 7.0
"""How many spans before the training's end the average begins, if the training is so long."""


class WeightAverage(BaseCallback):
    """An exponential moving average of the policy's weights, updated before every rollout.

    Source:
        B. T. Polyak and A. B. Juditsky 1992, "Acceleration of Stochastic Approximation by
        Averaging", SIAM Journal on Control and Optimization 30; here with exponential weights.

    Args:
        share: time constant of the average, as a share of the whole training; 0 for no average.

    Attributes:
        weights: the average of each of the policy's parameters; none before it begins.
    """

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share
        self.weights: list[torch.Tensor] = []

    def _on_training_start(self) -> None:
        self._updated = self.model.num_timesteps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        now, total = self.model.num_timesteps, self.model._total_timesteps
        since, self._updated = now - self._updated, now
        if now < (1.0 - SPANS * self.share) * total:
            return
        own = self._own()
        if not self.weights:
            self.weights = [one.clone() for one in own]
        weight = min(1.0, since / (self.share * total))
        for mean, one in zip(self.weights, own, strict=True):
            mean.lerp_(one, weight)

    @contextmanager
    def applied(self) -> Iterator[None]:
        """Inside, the model has the averaged weights, if there are any."""
        own = [one.clone() for one in self._own()]
        try:
            self._set(self.weights or own)
            yield
        finally:
            self._set(own)

    def _own(self) -> list[torch.Tensor]:
        return [parameter.data for parameter in self.model.policy.parameters()]

    def _set(self, weights: list[torch.Tensor]) -> None:
        for parameter, one in zip(self._own(), weights, strict=True):
            parameter.copy_(one)


CLASSES: dict[str, Any] = {"ppo": PPO, "sac": SAC, "td3": TD3, "tqc": TQC}
"""Class of each algorithm."""

EVALUATIONS = 10
"""How often a policy is validated, and the training saved, while it learns."""


@dataclass(frozen=True)
class Order:
    """Request for a training.

    Attributes:
        preset: with what.
        seed: of everything random in it.
        threads: of PyTorch and of the environments.
    """

    preset: Preset
    seed: int
    threads: int = 1


class Trained(NamedTuple):
    """Result of a training.

    Attributes:
        model: with the weights of its best validation.
        curve: its validations.
        best: the validation with the least mean error, in which a lost station shows.
    """

    model: Any
    curve: list[Point]
    best: Point


OnProgress = Callable[[int, Point | None], None]
"""Is told of progress: control steps so far, and a validation if there was one."""


def learner(preset: Preset, envs: VecEnv, seed: int) -> BaseAlgorithm:
    """A model that has learned nothing yet.

    Raises:
        PresetError: settings that Stable-Baselines3 refuses.
    """
    try:
        settings = {key: _value(value) for key, value in preset.settings.items()}
        if preset.noise_std:
            settings["action_noise"] = NormalActionNoise(np.zeros(1), np.full(1, preset.noise_std))
        return CLASSES[preset.algorithm]("MlpPolicy", envs, seed=seed, device="cpu", **settings)
    # Values of any kind go to constructors, which may raise anything.
    except Exception as error:
        raise PresetError(f"preset {preset.name}, {preset.algorithm}: {error}") from error


def _value(value: object) -> Any:  # noqa: ANN401
    """A setting's value as rl-baselines3-zoo reads it, without evaluating anything."""
    if isinstance(value, str) and value.startswith("lin_"):
        return LinearSchedule(float(value.removeprefix("lin_")), 0.0, 1.0)
    if isinstance(value, str) and value.strip().startswith("dict("):
        return _literal(ast.parse(value.strip(), mode="eval").body)
    return value


def _literal(node: ast.expr) -> Any:  # noqa: ANN401
    """Value of Python text that has `dict(name=...)`, `nn.ReLU`, `nn.Tanh` and literals alone."""
    match node:
        case ast.Call(func=ast.Name(id="dict"), args=[], keywords=pairs):
            return {str(pair.arg): _literal(pair.value) for pair in pairs}
        case ast.Attribute(value=ast.Name(id="nn"), attr="ReLU" | "Tanh" as name):
            return getattr(torch.nn, name)
    return ast.literal_eval(node)


class CheckpointError(ValueError):
    """A checkpoint that cannot be saved or used; the message says why and what remains."""


def train(order: Order, out: Path, on_progress: OnProgress) -> Trained:
    """Train a policy, or go on with a training that was interrupted.

    Args:
        order: what is to be trained.
        out: folder of its checkpoint and logs.
        on_progress: called with the progress.
    Raises:
        PresetError: settings that Stable-Baselines3 refuses.
        CheckpointError: a checkpoint of another training, a damaged one, or one that cannot be
            saved.
    """
    preset = order.preset
    torch.set_num_threads(order.threads)
    formats = ["csv", "tensorboard"] if find_spec("tensorboard") else ["csv"]
    with (
        closing(training_environments(preset, order.threads)) as envs,
        closing(validation_environments(preset, order.threads)) as checks,
        closing(configure(str(out / "log"), formats)) as log,
    ):
        model = learner(preset, envs, order.seed)
        model.set_logger(log)
        watch = _Watch(order, checks, out, on_progress)
        watch.resume(model)
        left = preset.n_timesteps - model.num_timesteps
        if left > 0:
            callbacks = CallbackList([watch.average, watch])
            model.learn(left, callback=callbacks, reset_num_timesteps=False)
        _, until_best = _load(watch.best, model)
    return Trained(model, watch.curve, until_best[-1])


class _Watch(BaseCallback):
    """Validates, saves the model and its best weights as Stable-Baselines3 does, tells of progress.

    Attributes:
        best: file of the model with the weights of its best validation.
    """

    def __init__(self, order: Order, checks: VecEnv, out: Path, on_progress: OnProgress) -> None:
        super().__init__()
        self._order, self._checks, self._on_progress = order, checks, on_progress
        self._last, self.best = out / "checkpoint.zip", out / "best.zip"
        self.average = WeightAverage(order.preset.average_share)
        self.curve: list[Point] = []
        self._began = time.perf_counter()

    def resume(self, model: Any) -> None:  # noqa: ANN401 - with attributes that are saved with it
        """Put the training where its checkpoint was, if there is one."""
        # All that moves the result.
        order = {**asdict(self._order.preset), "seed": self._order.seed}
        model.order, model.curve = order | {"threads": self._order.threads}, self.curve
        if not (self._last.exists() and self.best.exists()):
            return
        steps, curve = _load(self._last, model)
        model.num_timesteps = steps
        self.curve += curve
        self._began -= curve[-1].wall_s
        if hasattr(model, "learning_starts"):
            # What is replayed is collected anew.
            model.learning_starts += steps
        # What comes now is drawn anew, not as it was at the beginning.
        model.set_random_seed(self._order.seed + steps)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        share = self._order.preset.n_timesteps / EVALUATIONS
        if not self.curve or self.model.num_timesteps >= self.curve[-1].steps + share:
            self._validate()
        self._on_progress(self.model.num_timesteps, None)

    def _on_training_end(self) -> None:
        if self.model.num_timesteps > self.curve[-1].steps:
            self._validate()

    def _validate(self) -> None:
        files: dict[Path, bytes] = {}
        with self.average.applied():
            wall_s = round(time.perf_counter() - self._began, 3)
            point = validate(self.model, self._checks, self._order.preset.task, wall_s)
            best = all(point.mean < earlier.mean for earlier in self.curve)
            self.curve.append(point)
            if best:
                files[self.best] = _saved(self.model)
        try:
            replace_files(files | {self._last: _saved(self.model)})
        except OSError as error:
            raise CheckpointError(
                f"{self._last} cannot be saved: {error}; the checkpoint before it stays; make room "
                "or allow writing, then run the same command again: it goes on from there"
            ) from error
        self._on_progress(point.steps, point)


def _saved(model: BaseAlgorithm) -> bytes:
    file = io.BytesIO()
    model.save(file)
    return file.getvalue()


def _load(path: Path, model: Any) -> tuple[int, list[Point]]:  # noqa: ANN401 - with its order
    """Give a model the weights that were saved: nothing of the file is unpickled or executes.

    Returns:
        Control steps and curve up to there.
    Raises:
        CheckpointError: a damaged file, or another training's.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            data: Any = parse_json(archive.read("data"), str(path), finite=False)
        other = [
            f"{key} was {data['order'][key]}, is {value}"
            for key, value in model.order.items()
            if data["order"][key] != value
        ]
        if not other:
            _, parameters, variables = load_from_zip_file(path, load_data=False)
            model.set_parameters(parameters)
            for name, tensor in (variables or {}).items():
                getattr(model, name).data.copy_(tensor)
            return int(data["num_timesteps"]), [Point(*point) for point in data["curve"]]
    # Whatever a damaged file holds.
    except Exception as error:
        raise CheckpointError(
            f"{path} is damaged ({reason(error)}); delete it to train from the beginning"
        ) from error
    raise CheckpointError(
        f"{path} is of another training: {'; '.join(other)}; give another --out, or delete that "
        "file"
    )
