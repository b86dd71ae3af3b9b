"""What a policy sees of a trial: entries made of readings, the reference and its own actions.

What entries of a policy's view are measured by: of small errors, and of an exercise.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from controllers.registry import Reference
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.engine.observation import BOUND, ROTATION_SCALE, ObservationTable, Prescribed
from pma_gym.engine.options import Options
from pma_gym.envs import Measurement, StationInfo
from pma_gym.tasks import Task
from pma_gym.units import SI_FACTORS

FINE_SHARE = 0.01
"""Share of the task's range that an error of 1.0 stands for: 0.25 mm, 0.9 deg.

The sensors' noise is a tenth of it, so that a network of ordinary weights hears it; what is worse
than five times as large is clipped.
"""

PRESSURE_CHANGE, LOAD_CHANGE = 20e3, 50.0
"""Change of the pressure (Pa), and of the load (N), that 1.0 stands for."""

COARSE_SHARE = 0.04
"""The same of an exercise, 3.6 deg: a joint that nobody has begun to turn yet is 5 deg late."""

EXERCISE_PRESSURE, EXERCISE_LOAD = 100e3, 200.0
"""What 1.0 stands for in an exercise: change of the pressure (Pa), and load (N)."""


class Scales:
    """What the entries of a trial are measured by.

    Args:
        station: as controllers know it; its model must be of a station.

    Attributes:
        fine: error that 1.0 stands for (m or rad).
        span: the task's range (m or rad).
        quantity: what the task asks for.
        radius: of the nominal pulley (m).
        delay: control steps after which a command is in force.
    """

    def __init__(self, station: StationInfo) -> None:
        parameters = station.model.parameters
        if "drive" not in parameters or "rotor" not in parameters:
            raise ValueError(
                f"a tracking view needs the model of a station, with its drive and pulley; got "
                f"{station.model.name}, a {station.model.plant}: take station or serres2008"
            )
        schedule = station.task.schedule
        self.span, self.fine = schedule.span, FINE_SHARE * schedule.span
        self.quantity = schedule.quantity
        self.radius = parameters["rotor"].radius
        self.delay = round((station.action_delay + station.observation_delay) / station.period)
        self._gain, self._offset = parameters["drive"].gain, parameters["drive"].offset
        self._constant_load = station.load

    def entries(self, reading: Any, reference: Any, start: Any, volts: Any) -> tuple[Any, ...]:  # noqa: ANN401
        """The four entries of a reading, before they are clipped; of numbers or arrays.

        Args:
            reading: extension (m), rotation (rad), load (N), pressure (Pa).
            reference: when the reading was taken (m or rad).
            start: pressure that the trial began at (Pa).
            volts: motor voltage in force then (V), if the task is the motor's.
        """
        extension, rotation, load, pressure = reading
        if SIGNALS[self.quantity].is_angle:
            own, other = rotation, extension / self.radius
        elif SIGNALS[self.quantity].shortens:
            own, other = -extension, -self.radius * rotation
        else:
            own, other = extension, self.radius * rotation
        asked = self._constant_load if self._constant_load else self._gain * volts + self._offset
        # The drive cannot push; half the sum of a number and its size is its positive part.
        asked = 0.5 * (asked + abs(asked))
        return (
            (reference - own) / self.fine,
            (reference - other) / self.fine,
            (pressure - start) / PRESSURE_CHANGE,
            (load - asked) / LOAD_CHANGE,
        )


class ExerciseScales(Scales):
    """What the entries of an exercise are measured by: as `Scales`, of a regulator that resists."""

    def __init__(self, station: StationInfo) -> None:
        super().__init__(station)
        exercise = station.task.exercise
        assert exercise is not None
        self._plan = exercise.prescription
        self._coarse = COARSE_SHARE * self.span

    def entries(self, reading: Any, reference: Any, start: Any, volts: Any) -> tuple[Any, ...]:  # noqa: ANN401, ARG002
        """The four entries of a reading, before they are clipped; of numbers or arrays.

        Args:
            reading: extension (m), rotation (rad), load (N), pressure (Pa).
            reference: when the reading was taken (rad, or 0 N m).
            start: pressure that the trial began at (Pa).
            volts: of no use here: the motor is the operator's.
        """
        extension, rotation, load, pressure = reading
        if self._plan is None:
            first = (reference - rotation) / self._coarse
            second = (reference - extension / self.radius) / self.fine
        else:
            first = -Prescribed(self.radius, self._plan).excess(load, rotation) / self._coarse
            second = rotation / ROTATION_SCALE
        return first, second, (pressure - start) / EXERCISE_PRESSURE, load / EXERCISE_LOAD


def scales_of(station: StationInfo) -> Scales:
    """What a station's entries are measured by."""
    return ExerciseScales(station) if station.task.exercise else Scales(station)


def delayed_rows(task: Task) -> list[tuple[str, str]]:
    """Names of the four entries of a reading, and what 1.0 stands for, in order."""
    error, fine = "reference less measured position", share_of(task.schedule, FINE_SHARE)
    change, other = (
        "pressure less pressure at the trial's start",
        "reference less position by the other sensor",
    )
    if task.exercise is None:
        load = "load less what the nominal drive is asked for"
        return [(error, fine), (other, fine), (change, "20 kPa"), (load, "50 N")]
    coarse, rest = share_of(task.schedule, COARSE_SHARE), [(change, "100 kPa"), ("load", "200 N")]
    if task.exercise.prescription is None:
        return [(error, coarse), (other, fine), *rest]
    return [("prescribed less measured moment", coarse), ("measured rotation", "90 deg"), *rest]


def share_of(schedule: TrialSchedule, share: float) -> str:
    """A share of a task's range in words.

    >>> from pma_gym.tasks import TASKS
    >>> share_of(TASKS["rotation"].schedule, 0.01)
    '0.9 deg'
    """
    return f"{share * schedule.span / SI_FACTORS[schedule.unit]:g} {schedule.unit}"


ViewKind = Literal["tracking", "environment"]
VIEW_KINDS: tuple[ViewKind, ...] = ("tracking", "environment")

LONGEST = 64
"""Most steps that a view looks back or ahead."""

PRESSURE_CENTRE, PRESSURE_HALF = 362.5e3, 212.5e3
"""Middle and half of the pressures of table I3, 150-575 kPa (Pa)."""


@dataclass(frozen=True)
class ObservationSpec:
    """Which entries a policy is given.

    `tracking` is made for small errors: those of both position sensors, the pressure's change since
    the trial began, and the load less what the nominal drive gives for the voltage in force, now
    and in the control steps before; the reference's way in the steps ahead; the voltages commanded
    last. In an exercise, whose errors are larger, it has the load as it is; where a moment is
    prescribed, its error and the angle in place of the errors of position. `environment` is the
    environment's own observation.

    Args:
        kind: `tracking` or `environment`.
        preview: references ahead that it has, one a control step.
        history: how many steps back it looks.
    """

    kind: ViewKind = "tracking"
    preview: int = 6
    history: int = 6

    def __post_init__(self) -> None:
        if self.kind not in VIEW_KINDS:
            raise ValueError(f"view kind must be one of {', '.join(VIEW_KINDS)}, got {self.kind!r}")
        for name in ("preview", "history"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LONGEST:
                raise ValueError(
                    f"view {name} must be a whole number of control steps in 0-{LONGEST}, got "
                    f"{value!r}"
                )

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> "ObservationSpec":
        """An observation specification from JSON.

        Raises:
            ValueError: a key that is unknown or missing, or a value out of range.
        """
        strange = sorted(set(document) ^ {"kind", "preview", "history"})
        if strange:
            raise ValueError(f"a view has kind, preview and history; check {', '.join(strange)}")
        return cls(**document)

    def to_json(self) -> dict[str, Any]:
        """The specification as JSON."""
        return asdict(self)

    def rows(self, station: StationInfo, base: str | None = None) -> list[tuple[str, str]]:
        """Entries and what 1.0 stands for, in order.

        Args:
            station: its task, with the control period and delays.
            base: name of the controller that the policy adds to, if it does.
        """
        if self.kind == "environment":
            return self.table(station).rows
        schedule = station.task.schedule
        span = share_of(schedule, 1.0)
        fine = share_of(schedule, FINE_SHARE)
        rows = [
            ("reference now", span),
            ("pressure at the trial's start less 362.5 kPa", "212.5 kPa"),
            *(
                (f"reference {k} ahead less reference now, over {k}", fine)
                for k in range(1, self.preview + 1)
            ),
        ]
        for k in range(self.history + 1):
            before = f", {k} before" if k else ""
            rows += [(f"{name}{before}", unit) for name, unit in delayed_rows(station.task)]
        rows += [(f"own action, {k} before", "1") for k in range(1, self.history + 1)]
        rows += [("voltage commanded last", "5 V, -1.0 = 0 V")]
        if base is not None:
            rows += [(f"voltage of {base} less the one commanded last", "1 V")]
        return rows

    def table(self, station: StationInfo) -> ObservationTable:
        """The environment's own observation with this preview and history."""
        return ObservationTable(
            station.task,
            Options(
                control_rate_hz=1.0 / station.period,
                preview=self.preview,
                history=self.history,
                action_delay_s=station.action_delay,
                observation_delay_s=station.observation_delay,
            ),
        )


def steps_of(reference: Reference, station: StationInfo, preview: int) -> NDArray[np.float64]:
    """The reference at every control step and `preview` steps past the end (m or rad)."""
    last = station.task.steps(1.0 / station.period) + preview
    return np.array([reference(k * station.period) for k in range(last + 1)])


def ahead(references: NDArray[np.float64], preview: int, scales: Scales) -> NDArray[np.float64]:
    """Entries that depend on the reference alone, shape (steps, 1 + preview)."""
    now = references[: len(references) - preview]
    columns = [now / scales.span]
    for k in range(1, preview + 1):
        columns.append((references[k : k + len(now)] - now) / (k * scales.fine))
    return np.stack(columns, axis=1)


def start_entry(start: Any) -> Any:  # noqa: ANN401
    """The entry of the pressure that a trial began at (Pa)."""
    return (start - PRESSURE_CENTRE) / PRESSURE_HALF


def clipped(entries: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float32]:
    """Entries as a network gets them."""
    clipped_entries = np.asarray(entries, np.float32)
    return np.minimum(np.maximum(clipped_entries, np.float32(-BOUND)), np.float32(BOUND))


def environment_entries(
    table: ObservationTable,
    readings: Sequence[Measurement],
    reference: Callable[[int], float],
    action: float,
) -> list[float]:
    """The environment's own entries.

    Args:
        table: the environment's.
        readings: as received now and in the steps before, the latest first.
        reference: reference (m or rad) so many steps ahead.
        action: the last one, -1 to 1.
    """
    delay = table.delay

    def reading(part: str, steps: int) -> float:
        return getattr(readings[min(steps - delay, len(readings) - 1)], part)

    return table.entries(reading, reference, [action])
