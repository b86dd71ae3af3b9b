"""The observation: a table of entries that computes, describes and bounds it."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.engine.options import Options
from pma_gym.tasks import TASKS, MomentProfile, Task
from pma_gym.units import SI_FACTORS

BOUND = 5.0
"""Entries are clipped to +-5; all but runaway states stay within +-2."""

EXTENSION_SCALE = TASKS["displacement"].schedule.span
ROTATION_SCALE = TASKS["rotation"].schedule.span
LOAD_SCALE = 1000.0
PRESSURE_SCALE = 600e3
"""Scale of each entry: the value that is 1.0 in the observation (m, rad, N, Pa)."""


class Prescribed(NamedTuple):
    """Prescribed moment at a joint, in numbers or traced values.

    Attributes:
        radius: radius of the pulley (m).
        plan: prescribed moment as a function of the angle.
    """

    radius: Any
    plan: MomentProfile

    def excess(self, load: Any, angle: Any) -> Any:  # noqa: ANN401
        """Moment of a load (N) minus the moment prescribed at an angle (rad), in N m."""
        return self.radius * load - self.plan.at(angle)


class ObservationTable:
    """Entries of the observation for a task and options.

    Args:
        task: the task.
        options: the environment's options.

    Attributes:
        rows: (entry, scale of 1.0) in order.
        space: the observation space.
    """

    def __init__(self, task: Task, options: Options) -> None:
        """List the entries."""
        schedule = task.schedule
        self.rows = _rows(task, options)
        self.space = spaces.Box(-BOUND, BOUND, (len(self.rows),), np.float32)
        self._span = schedule.span
        self._preview = options.preview
        self._history, self.delay = options.history, options.observation_delay
        self._quantity = schedule.quantity

    def describe(self) -> str:
        """The table of entries as text.

        >>> print(ObservationTable(TASKS["displacement"], Options(preview=1)).describe())
        0  measured extension                      1.0 = 25 mm
        1  measured rotation                       1.0 = 90 deg
        2  measured load                           1.0 = 1000 N
        3  measured pressure                       1.0 = 600 kPa
        4  reference now                           1.0 = 25 mm
        5  reference now less measured position    1.0 = 25 mm
        6  reference 1 control step ahead          1.0 = 25 mm
        7  last motor action                       1.0 = 10 V, -1.0 = 0 V
        """
        width = max(len(name) for name, _ in self.rows) + 4
        digits = len(str(len(self.rows) - 1))
        return "\n".join(
            f"{i:{digits}}  {name:<{width}}1.0 = {unit}" for i, (name, unit) in enumerate(self.rows)
        )

    def entries(
        self,
        reading: Callable[[str, int], Any],
        reference: Callable[[int], Any],
        action: Sequence[Any],
        prescribed: Prescribed | None = None,
    ) -> list[Any]:
        """Compute the entries before clipping, from numbers or traced values.

        Args:
            reading: function of a measured signal's name and its age in control steps (SI).
            reference: function of the control steps ahead that returns the reference (m or rad).
            action: the last action, -1 to 1.
            prescribed: the prescribed moment, in an exercise that has one.
        """
        delay = self.delay

        def position(steps: int) -> Any:  # noqa: ANN401
            return measured_position(self._quantity, lambda part: reading(part, steps), prescribed)

        now = reference(0) * (1.0 / self._span)
        error = now - position(delay) * (1.0 / self._span)
        if prescribed is not None:
            # An excess is an error by itself; what it is of stands in the reference's place.
            now = prescribed.plan.at(reading("rotation", delay)) * (1.0 / self._span)
        return [
            reading("extension", delay) * (1.0 / EXTENSION_SCALE),
            reading("rotation", delay) * (1.0 / ROTATION_SCALE),
            reading("load", delay) * (1.0 / LOAD_SCALE),
            reading("pressure", delay) * (1.0 / PRESSURE_SCALE),
            now,
            error,
            *(reference(k) * (1.0 / self._span) for k in range(1, self._preview + 1)),
            *action,
            *(position(delay + k) * (1.0 / self._span) for k in range(1, self._history + 1)),
        ]


def step_references(task: Task, options: Options) -> NDArray[np.float64]:
    """Reference (m or rad) at every control step, and `preview` steps past the end."""
    last = task.steps(options.control_rate_hz) + options.preview
    return task.schedule.reference(np.arange(last + 1) * options.period)


def measured_position(
    quantity: str, reading: Callable[[str], Any], prescribed: Prescribed | None = None
) -> Any:  # noqa: ANN401
    """Measured position of the task's controlled quantity (m, rad or N m), from signals by name."""
    if prescribed is not None:
        return prescribed.excess(reading("load"), reading("rotation"))
    return -reading("extension") if SIGNALS[quantity].shortens else reading(quantity)


def _rows(task: Task, options: Options) -> list[tuple[str, str]]:
    unit = task.schedule.unit
    span = f"{task.schedule.span / SI_FACTORS[unit]:g} {unit}"
    volts = "10 V, -1.0 = 0 V"
    now, less, delayed = "reference now", "reference now less measured position", "position heard"
    if task.schedule.followed.is_force:
        now, less = "prescribed moment at the measured angle", "prescribed less measured moment"
        delayed = "excess of the moment heard"
    return [
        ("measured extension", "25 mm"),
        ("measured rotation", "90 deg"),
        ("measured load", "1000 N"),
        ("measured pressure", "600 kPa"),
        (now, span),
        (less, span),
        *((f"reference {_steps(k)} ahead", span) for k in range(1, options.preview + 1)),
        (f"last {task.actuator} action", volts),
        *([("last regulator action", volts)] if options.regulator_action else []),
        *((f"{delayed} {_steps(k)} before", span) for k in range(1, options.history + 1)),
    ]


def _steps(count: int) -> str:
    return f"{count} control step{'s' if count > 1 else ''}"
