"""An exercise that is run again and again with the same operator, by voltages given beforehand.

An environment of one seed gives the same operator and the same unsteadiness, bit by bit, however
often it is run; he still reacts to the angle. Many voltages are run side by side.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.actions import HIGHEST_VOLTAGE
from pma_gym.engine.option_checks import Pressure
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.model import Model
from pma_gym.tasks import Operator, Task
from pma_gym.units import SI_FACTORS

RATE_HZ = 100.0
"""Control steps a second (Hz), as the suite."""

LAG = "regulator_lag.time_constant_s"

NO_LAG = 0.002
"""Time constant of a regulator that has hardly any lag (s): a fifth of a control step."""


@dataclass(frozen=True)
class Exertion:
    """An exercise that can be repeated: one operator on one station.

    Attributes:
        task: the exercise.
        seed: of the environment, and so of operator and unsteadiness.
        model: the station.
        pressure_kpa: gauge pressure that it begins at (kPa), or "random" for one by the seed.
        operator: the operator, as the environment's option.
        safety: whether the safety layer stands between.
    """

    task: str | Task
    seed: int
    model: Model
    pressure_kpa: Pressure = "random"
    operator: str | Operator = "random"
    safety: bool = False


@dataclass(frozen=True)
class Course:
    """An exercise by given voltages.

    Attributes:
        voltages: of the regulator in every control step (V), shape (steps,).
        error: of the score's quantity at the steps' ends (deg or N m), shape (steps,).
        by_phase: RMSE of each phase at 384 Hz (deg or N m).
        iterations: how often the voltages had been improved.
    """

    voltages: NDArray[np.float64]
    error: NDArray[np.float64]
    by_phase: Mapping[str, float]
    iterations: int = 0

    @property
    def cost(self) -> float:
        """Sum of the squared errors, infinite where a limit ended it."""
        return float(costs(self.error))

    @property
    def saturated(self) -> float:
        """Share of the steps whose voltage is at 0 or at 10 V."""
        at_end = (self.voltages <= 0.0) | (self.voltages >= HIGHEST_VOLTAGE)
        return float(np.mean(at_end))


@dataclass(frozen=True)
class Runs:
    """Many runs side by side; shape (steps, runs) or (runs,).

    Attributes:
        error: at the steps' ends, NaN from where a limit ended the run.
        by_phase: RMSE by phase, NaN of a run that was ended.
    """

    error: NDArray[np.float64]
    by_phase: Mapping[str, NDArray[np.float64]]

    @property
    def cost(self) -> NDArray[np.float64]:
        """Sum of the squared errors, infinite for a run that was ended."""
        return costs(self.error)


def costs(error: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of squared errors, shape (steps, ...), over the steps; infinite with a NaN."""
    total = np.sum(error**2, axis=0)
    return np.where(np.isfinite(total), total, np.inf)


class RepeatedExercise:
    """Runs an exercise by many voltages at once.

    Args:
        exertion: which.
        count: how many runs.
    """

    def __init__(self, exertion: Exertion, count: int) -> None:
        self.exertion, self.count = exertion, count
        self._environments = PMAVectorEnv(
            count,
            exertion.task,
            model=exertion.model,
            pressure_kpa=exertion.pressure_kpa,
            operator=exertion.operator,
            safety=exertion.safety,
            noise=False,
            control_rate_hz=RATE_HZ,
        )
        self.task = self._environments.task
        schedule = self.task.schedule
        self._suffix, self._phases = schedule.suffix, [phase.name for phase in schedule.phases]

    @cached_property
    def steps(self) -> int:
        """Control steps of a whole exercise."""
        return self.task.steps(RATE_HZ)

    def start_voltage(self) -> float:
        """Regulator voltage that holds the pressure that the exercise begins at (V)."""
        self._environments.reset(seed=[self.exertion.seed] * self.count)
        return float(self._environments.engine.numbers("rest_regulator")[0])

    def run(self, voltages: NDArray[np.float64]) -> Runs:
        """Run it by voltages (V), shape (steps, runs); fewer runs than there are, or as many."""
        environments, runs = self._environments, voltages.shape[1]
        environments.reset(seed=[self.exertion.seed] * self.count)
        error = np.full((self.steps, self.count), np.nan)
        alive = np.ones(self.count, bool)
        info: Mapping[str, Any] = {}
        actions = np.full((self.count, 1), -1.0)
        for step, volts in enumerate(voltages):
            actions[:runs, 0] = 2.0 * volts / HIGHEST_VOLTAGE - 1.0
            actions[runs:] = actions[0]
            _, _, terminated, _, info = environments.step(actions)
            alive &= ~terminated
            error[step, alive] = environments.engine.numbers(f"error_{self._suffix}")[alive]
        by_phase = self._scores(info, alive)
        return Runs(error[:, :runs], {name: one[:runs] for name, one in by_phase.items()})

    def _scores(
        self, info: Mapping[str, Any], alive: NDArray[np.bool_]
    ) -> dict[str, NDArray[np.float64]]:
        keys = {name: f"rmse_{name}_{self._suffix}" for name in self._phases}
        return {name: np.where(alive, info.get(key, np.nan), np.nan) for name, key in keys.items()}

    def course(self, voltages: NDArray[np.float64], iterations: int = 0) -> Course:
        """The exercise by one row of voltages (V), shape (steps,)."""
        run = self.run(voltages[:, None])
        by_phase = {name: float(values[0]) for name, values in run.by_phase.items()}
        return Course(voltages, run.error[:, 0], by_phase, iterations)


def own_floor(exertion: Exertion) -> float:
    """RMSE of the first phase that the operator leaves who meets no resistance at all (deg).

    As long as he is behind the line a device that resists can only leave him further behind: with
    the regulator at 0 V from the start, and at once, his joint runs as far ahead as it can. Only
    what he is late then counts, to where he gets ahead or a limit ends the run. A floor of any
    command's RMSE, for the time in which his own stiffness does not swing back: half a period of
    leg and knee, some 1 s at the stiffest of those whose pace is set.

    Args:
        exertion: an exercise that holds the speed; its regulator is taken to have hardly any lag.
    """
    environment = PMAEnv(
        exertion.task,
        model=exertion.model.replace({LAG: NO_LAG}),
        pressure_kpa=exertion.pressure_kpa,
        operator=exertion.operator,
        safety=False,
        noise=False,
    )
    environment.reset(seed=exertion.seed)
    ended = False
    while not ended:
        _, _, terminated, truncated, _ = environment.step(environment.action(0.0))
        ended = terminated or truncated
    phase = environment.task.schedule.phases[0]
    angle = environment.trajectory()[: phase.samples]
    line = phase.initial + phase.slope * np.arange(len(angle)) / SAMPLE_RATE_HZ
    ahead = angle > line
    late = np.where(np.logical_or.accumulate(ahead[1:]), 0.0, (line - angle)[1:])
    total = float(np.sum(late**2)) / phase.samples
    return float(np.sqrt(total)) / SI_FACTORS["deg"]
