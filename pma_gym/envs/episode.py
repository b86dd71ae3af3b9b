"""Readable state of an episode, from the engine's record."""

import copy
import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.engine.engine import Engine
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.options import Options
from pma_gym.engine.state_layout import HAND_PUSH, START, TRUTH
from pma_gym.envs.station_info import Measurement, Reference, StationInfo, detached_task
from pma_gym.envs.summary import episode_summary
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition
from pma_gym.tasks import Events, Operator, Task

NOT_BEGUN = "no episode has begun"


class Episode:
    """Read-only view of an environment's episode, for agents, controllers and analysis.

    `PMAEnv` and the members of a batch inherit it.

    Attributes:
        task: the Task of this episode.
        options: the checked Options.
        table: the ObservationTable.
        nominal_plant: the Plant of the nominal model.
    """

    options: Options
    table: ObservationTable
    nominal_plant: Plant
    _engine: Engine
    _index: int = 0
    """Index of the environment in the engine."""
    _row: NDArray[np.float64]
    """The engine's record of the environment."""
    _idle: str | None
    _detached: tuple[Task, Task] | None = None
    """The task of an episode, and its copy for controllers."""

    @property
    def task(self) -> Task:
        """The task of this episode; with `reference` every reset draws it."""
        return self._engine.tasks[self._index]

    def _find_offsets(self) -> None:
        self._offsets = self._engine.state_layout.offsets
        # The record holds a reading's parts side by side.
        parts = self._engine.state_layout.parts
        first = self._offsets[f"{parts[0]}_{self.options.observation_delay}"]
        self._measured = slice(first, first + len(parts))
        self._datum = START if START in self._offsets else "zero_contraction"

    def _number(self, name: str) -> float:
        return float(self._row[self._offsets[name]])

    @cached_property
    def plant(self) -> Plant:
        """The Plant of this episode; differs from the nominal one with `randomisation`."""
        return self._episode_plant()

    def _episode_plant(self) -> Plant:
        model = self._engine.models[self._index]
        nominal = self.nominal_plant
        return nominal if model is nominal.model else Plant(model, nominal.tolerance)

    @property
    def pressure(self) -> float:
        """Gauge pressure at the start of this episode (Pa)."""
        return float(self._engine.pressures[self._index])

    @property
    def condition(self) -> Condition:
        """Copy of the plant's present condition."""
        state = np.array([self._number(name) for name in self.nominal_plant.states])
        zero, size = self._number("zero_contraction"), self._number("size")
        return Condition(state, zero, self.time, size, (self.motor_voltage, self.regulator_voltage))

    @property
    def _count(self) -> int:
        """Control steps so far."""
        return int(self._row.view(np.int64)[self._offsets["count"]])

    @property
    def time(self) -> float:
        """Time since the trial began (s)."""
        return self._count * self.options.period

    @property
    def measurement(self) -> Measurement:
        """The measurement that the agent receives, `observation_delay_s` old."""
        taken = max(self._count - self.options.observation_delay, 0) * self.options.period
        return Measurement(taken, *self._row[self._measured].tolist())

    @property
    def truth(self) -> dict[str, float]:
        """True contraction, extension (m), rotation (rad), load (N) and pressure (Pa).

        Contraction is relative to the resting length and extension to the trial's start. Rotation
        is relative to the angle at which an unloaded cable tightens, in an exercise to the trial's
        start.
        """
        truth = {name: self._number(f"true_{name}") for name in TRUTH}
        return truth | {"extension": self._number(self._datum) - truth["contraction"]}

    @property
    def position(self) -> float:
        """True position of the task's controlled quantity (m, rad; N m for a moment's excess)."""
        truth = self.truth
        if self.task.schedule.followed.shortens:
            return truth["contraction"] - self._number(START)
        if self.task.schedule.followed.is_force:
            return self._number("excess_nm")
        return truth[self.task.schedule.quantity]

    @property
    def operator(self) -> Operator | None:
        """The exercise's operator; None without one, or before a reset. Not for controllers."""
        if self.task.exercise is None or self._idle == NOT_BEGUN:
            return None
        return Operator(*(self._number(f"operator_{name}") for name in Operator._fields))

    @property
    def disturbance(self) -> tuple[float, float]:
        """Disturbances in the last step: the regulator's jump (V) and the hand's force (N)."""
        jumps = [name for name in self._offsets if name.startswith("jump_step_")]
        count = self._count - 1
        volts = [
            self._number(name.replace("_step", "")) for name in jumps if count >= self._number(name)
        ]
        force = self._number(HAND_PUSH) if HAND_PUSH in self._offsets else 0.0
        return sum(volts), force

    @property
    def events(self) -> Events:
        """Disturbances of this episode with their times; not for controllers."""
        return self._engine.events(self._index)

    @property
    def station(self) -> StationInfo:
        """Station data for controllers, in copies: nominal model, task, pressure and delays."""
        options = self.options
        return StationInfo(
            copy.copy(self._engine.nominal_model),
            self._detached_task,
            self.pressure,
            options.period,
            options.action_delay * options.period,
            options.observation_delay * options.period,
        )

    @property
    def error(self) -> float:
        """True position minus reference (m or rad)."""
        references = self._engine.references(self._index)
        return self.position - float(references[self._count])

    @property
    def extrapolated(self) -> bool:
        """Whether the pressure is outside the range of the task's trials or of the model."""
        return self._number("extrapolated") != 0.0

    @property
    def motor_voltage(self) -> float:
        """Motor voltage at the station in the last step (V)."""
        return self._number("motor_voltage")

    @property
    def regulator_voltage(self) -> float:
        """Regulator voltage at the station in the last step (V)."""
        return self._number("regulator_voltage")

    @property
    def motor_voltages(self) -> NDArray[np.float64]:
        """Motor voltage at the station in every step so far (V), shape (steps,).

        Raises:
            AttributeError: in an exercise, which does not record the operator's motor.
        """
        if self.task.exercise:
            raise AttributeError(
                "motor_voltages are not kept in an exercise, where the motor plays the operator; "
                'collect info["motor_voltage_v"] of every step'
            )
        if self.task.actuator == "motor":
            return self.voltages
        return np.full(self._count, self.motor_voltage)

    @property
    def voltages(self) -> NDArray[np.float64]:
        """Voltage of the task's actuator at the station in every step so far (V)."""
        return self._engine.voltages[: self._count].copy()

    @property
    def reference(self) -> Reference:
        """The reference, called with a time (s): extension, contraction (m) or rotation (rad)."""
        return Reference(self._detached_task.schedule)

    @property
    def _detached_task(self) -> Task:
        """What controllers get of the task; made once, so that repeated trials have equal ones."""
        if self._detached is None or self._detached[0] is not self.task:
            self.__dict__["_detached"] = self.task, detached_task(self.task)
        return self.__dict__["_detached"][1]

    def trajectory(self) -> NDArray[np.float64]:
        """True positions (m or rad) at k / 384 s so far, at every control rate, shape (k,)."""
        return self._engine.trace[: math.floor(self._number("sample") + 0.5)].copy()

    def episode_summary(self) -> dict[str, Any]:
        """Return the RMSE of the true position at 384 Hz so far, as the dissertation defines it.

        Returns:
            `rmse_mm` or `rmse_deg`: over all phases; `rmse_by_phase_mm` or `rmse_by_phase_deg`: of
            each phase so far, by name; `percent_of_range`: the first in percent of 25 mm, 90 deg or
            the contraction's stroke; `task`: name of the episode's task; `ended_by`: the limit that
            terminated the episode as text, or "". An exercise also has `exercise_summaries`, and
            its RMSE is in N m if it prescribes a moment.
        """
        return episode_summary(self._engine, self._index)
