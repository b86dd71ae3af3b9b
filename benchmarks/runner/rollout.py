"""Rollout of a case: a controller drives an environment for an episode."""

import copy
import math
import numbers
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from benchmarks.runner.controller_spec import ControllerError
from controllers.registry import Controller
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.envs import ENVIRONMENTS, Measurement, PMAEnv
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import Model
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS, suffix

# 5 s in steps of 0.01 s are 499.99999999999994 steps.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Rollout:
    """Record of an episode under a controller, to its end or to a physical limit.

    Attributes:
        task: the task.
        period: of the control steps (s).
        start: contraction that extension is counted from (m).
        position: true position (m or rad) at k / 384 s.
        asked: volts that the controller returned, before they are held to 0-10 V, shape (steps,).
        commands: motor and regulator voltage (V) in force in every control step, shape (steps, 2).
        readings: at the steps' beginnings and the end: extension, rotation, load, pressure (SI),
            shape (steps + 1, 4).
        truth: true contraction (m), load (N) and pressure (Pa) at the same instants.
        act_seconds: computing time of every `act` (s), shape (steps,).
        step_seconds: time spent inside the environment's steps (s).
        ended_by: the physical limit that ended it early, in words, or "".
    """

    task: Task
    period: float
    start: float
    position: NDArray[np.float64]
    asked: NDArray[np.float64]
    commands: NDArray[np.float64]
    readings: NDArray[np.float64]
    truth: Mapping[str, NDArray[np.float64]]
    act_seconds: NDArray[np.float64]
    step_seconds: float
    ended_by: str

    @property
    def steps(self) -> int:
        """Control steps that it took."""
        return len(self.commands)

    @cached_property
    def trial(self) -> Trial:
        """The rollout as a trial at 384 Hz: true position, commands in force, last readings."""
        volts, readings = self.commands[self._driven], self.readings[self._step]
        return Trial(
            time=self._times,
            commands={"motor_voltage": volts[:, 0], "regulator_voltage": volts[:, 1]},
            measurements={
                "contraction": self.start - readings[:, 0],
                "rotation": readings[:, 1],
                "load": readings[:, 2],
                "pressure": readings[:, 3],
            },
            truth={self.task.schedule.quantity: self.position + self._zero},
        )

    @property
    def trace(self) -> dict[str, NDArray[np.float64]]:
        """The rollout as a table at 384 Hz: values by column, with units in the names.

        Voltages and readings are the last ones. Positions are counted as the reference is; where
        no position is followed, none is measured.
        """
        schedule, trial = self.task.schedule, self.trial
        followed, factor = schedule.followed, SI_FACTORS[schedule.unit]
        positions = {"reference": schedule.reference(trial.time), "true_position": self.position}
        if followed.is_angle:
            positions["measured_position"] = trial.rotation
        elif followed.is_travel:
            pulled = self.start - trial.measurements["contraction"]
            positions["measured_position"] = -pulled if followed.shortens else pulled
        outputs = {f"measured_{name}": values for name, values in trial.measurements.items()}
        return {
            "time_s": trial.time,
            **{f"{name}_{schedule.suffix}": its / factor for name, its in positions.items()},
            "asked_voltage_v": self.asked[self._driven],
            **{
                f"{name}_{suffix(signal.unit)}": values / SI_FACTORS[signal.unit]
                for name, values in {**trial.commands, **outputs}.items()
                for signal in (SIGNALS[name.removeprefix("measured_")],)
            },
        }

    @cached_property
    def _times(self) -> NDArray[np.float64]:
        return np.arange(self.position.size) / SAMPLE_RATE_HZ

    @cached_property
    def _step(self) -> NDArray[np.int64]:
        """Control step of each sample."""
        return np.floor(self._times / self.period + _ROUNDING).astype(int)

    @property
    def _driven(self) -> NDArray[np.int64]:
        # The last grid point may fall on the end of the last step, where no further command came.
        return np.minimum(self._step, self.steps - 1)

    @property
    def clipped(self) -> tuple[float, float]:
        """Share of the steps that asked for volts outside 0-10 V, and the farthest beyond (V)."""
        beyond = np.maximum(self.asked - HIGHEST_VOLTAGE, -self.asked)
        return float(np.mean(beyond > 0.0)), float(np.max(beyond, initial=0.0))

    @property
    def _zero(self) -> float:
        """What the position is counted from, as trials count it (m or rad)."""
        return self.start if self.task.schedule.followed.shortens else 0.0


def make_environment(
    task: str, model: str, pressure_kpa: float, control_rate_hz: float = 100.0, noise: bool = True
) -> PMAEnv:
    """The registered environment of a task at one pressure, without wrappers."""
    identifier = next(name for name, its in ENVIRONMENTS.items() if its == task)
    environment = gym.make(
        identifier,
        model=model,
        pressure_kpa=float(pressure_kpa),
        control_rate_hz=control_rate_hz,
        noise=noise,
    ).unwrapped
    assert isinstance(environment, PMAEnv)
    return environment


def rollout(
    environment: PMAEnv,
    controller: Controller,
    seed: int,
    nominal: Model | None = None,
    reveal: bool = False,
) -> Rollout:
    """Let a controller drive one episode, or the last of its repetitions.

    A controller with `repetitions` has driven so many episodes when this ends, all but the last to
    practise: on the same station and reference, each with a noise of its own. It receives copies
    of the reference, the station and the readings, and no environment.

    Args:
        environment: of one pressure.
        controller: who drives; reset first.
        seed: seed of the episode.
        nominal: model that the controller receives, if the environment has another.
        reveal: hand the environment to the controller's method `receive` before each reset; only
            for the oracle, which is no rival but the bound that rivals are measured by.
    Returns:
        What happened, to the last scored sample or to where a physical limit ended it.
    Raises:
        ControllerError: the controller returned what is no voltage.
        Exception: whatever the controller or the environment raised.
    """
    for trial in range(1, getattr(controller, "repetitions", 1)):
        _begin(environment, controller, learning_seed(seed, trial), nominal, reveal)
        _drive(environment, controller, _Log())
    log = _Log()
    _begin(environment, controller, seed, nominal, reveal)
    _drive(environment, controller, log)
    return log.rollout(environment)


def learning_seed(seed: int, trial: int) -> int:
    """Seed of an episode before the one that is scored."""
    return int(np.random.SeedSequence([seed, trial]).generate_state(1)[0])


class _Log:
    """What is written down while an episode runs."""

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.commands: list[tuple[float, float]] = []
        self.readings: list[Measurement] = []
        self.truths: list[tuple[float, float, float]] = []
        self.act_seconds: list[float] = []
        self.step_seconds = 0.0
        self.start = 0.0

    def record(self, environment: PMAEnv) -> None:
        """Write down where the station stands."""
        truth = environment.truth
        if not self.readings:
            self.start = truth["contraction"] + truth["extension"]
        self.readings.append(environment.measurement)
        self.truths.append((truth["contraction"], truth["load"], truth["pressure"]))

    def rollout(self, environment: PMAEnv) -> Rollout:
        """All of it, at the episode's end."""
        last = environment.task.schedule.phases[-1]
        truths = np.array(self.truths).T
        return Rollout(
            task=environment.task,
            period=environment.options.period,
            start=self.start,
            position=environment.trajectory()[: last.first + last.samples],
            asked=np.array(self.asked),
            commands=np.array(self.commands),
            readings=np.array([reading[1:] for reading in self.readings]),
            truth=dict(zip(("contraction", "load", "pressure"), truths, strict=True)),
            act_seconds=np.array(self.act_seconds),
            step_seconds=self.step_seconds,
            ended_by=environment.ended_by,
        )


def _begin(
    environment: PMAEnv, controller: Controller, seed: int, nominal: Model | None, reveal: bool
) -> None:
    """Reset the environment and the controller."""
    environment.reset(seed=seed)
    if reveal:
        controller.receive(environment)  # type: ignore[attr-defined]
    station = environment.station
    if nominal is not None:
        # A copy: whatever the controller does to it, the next case receives the same model.
        station = replace(station, model=copy.copy(nominal))
    controller.reset(environment.reference, station)


def _drive(environment: PMAEnv, controller: Controller, log: _Log) -> None:
    """Run an episode to its end."""
    log.record(environment)
    clock, ended = time.perf_counter, False
    while not ended:
        now, reading = environment.time, log.readings[-1]
        asked = clock()
        answer = controller.act(reading, now)
        answered = clock()
        volts = checked_volts(answer, now)
        action = environment.action(volts)
        step_start = clock()
        _, _, terminated, truncated, _ = environment.step(action)
        log.step_seconds += clock() - step_start
        log.asked.append(volts)
        log.act_seconds.append(answered - asked)
        log.commands.append((environment.motor_voltage, environment.regulator_voltage))
        log.record(environment)
        ended = terminated or truncated


def checked_volts(volts: object, now: float) -> float:
    """A controller's answer as volts.

    Raises:
        ControllerError: it is no finite number; says what came and when.
    """
    if isinstance(volts, np.ndarray) and volts.size == 1:
        volts = volts.item()
    if isinstance(volts, bool) or not isinstance(volts, numbers.Real):
        raise ControllerError(
            f"act must return volts as a number, 0-10 V, at {now:.4g} s it returned {volts!r} "
            f"({type(volts).__name__}); return float(volts)"
        )
    if not math.isfinite(volts):
        raise ControllerError(
            f"act must return finite volts, 0-10 V, at {now:.4g} s it returned {float(volts)}; "
            "look for a division by zero or a root of a negative number there"
        )
    return float(volts)
