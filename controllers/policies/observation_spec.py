"""What a policy sees of a trial: entries made of readings, the reference and its own actions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from controllers.controller import Reference
from controllers.policies.scales import FINE_SHARE, Scales, delayed_rows, share_of
from pma_gym.engine.observation import BOUND, ObservationTable
from pma_gym.engine.options import Options
from pma_gym.envs import Measurement, StationInfo

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
    def of(cls, given: Mapping[str, Any]) -> "ObservationSpec":
        """An observation specification from JSON.

        Raises:
            ValueError: a key that is unknown or missing, or a value out of range.
        """
        strange = sorted(set(given) ^ {"kind", "preview", "history"})
        if strange:
            raise ValueError(f"a view has kind, preview and history; check {', '.join(strange)}")
        return cls(**given)

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
