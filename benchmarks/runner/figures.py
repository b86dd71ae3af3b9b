"""All figures of one episode: error by phase, start and steady tracking, effort, limits, time.

Errors are those of the true position at 384 Hz whatever the control rate, phase by phase as tables
22 and 30 have them (Serres 2008). SI comes in; what goes out is in the task's unit, mm or deg.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.metrics import SAMPLE_RATE_HZ, percent_of_range, rmse
from pma_gym.tasks import Task, phase_errors
from pma_gym.units import SI_FACTORS

START_S = 0.5
"""How long the start transient lasts (s): some five time constants of the nominal muscle."""

VOLTAGE_LIMITS = (0.0, 10.0)
"""Voltages at which an actuator is saturated (V)."""

REACH: dict[str, float] = {
    "contraction": 64.9e-3,
    "stretch": 5.4e-3,
    "tension": 900.0,
    "pressure": 575e3,
}
"""Soft limits (SI): the furthest that the station was shown to go, the largest no-load contraction,
stretch beyond the resting length, nominal load and nominal pressure of table I3 (Serres 2008)."""

TOLERANCE = 0.01
"""By which share of the hard limit a soft one may be passed before it counts (assumption)."""

SIGNALS = {
    "contraction": ("contraction", 1.0),
    "stretch": ("contraction", -1.0),
    "tension": ("load", 1.0),
    "pressure": ("pressure", 1.0),
}
"""Which true output a limit bounds, and its sign."""

WATCHED = {"motor": ("tension", "stretch"), "regulator": ("contraction", "stretch", "pressure")}
"""Limits that an actuator can break: a controller of the motor does not set the pressure."""


class PhaseFigures(NamedTuple):
    """Figures of one phase.

    Attributes:
        rmse: against the ideal (mm or deg).
        percent_of_range: the RMSE in percent of the task's range.
        largest_error: largest distance from the ideal (mm or deg).
    """

    rmse: float
    percent_of_range: float
    largest_error: float


class Episode(NamedTuple):
    """Record of an episode, SI.

    Attributes:
        position: true position (m or rad) at k / 384 s, from 0 to the task's end.
        voltages: what the actuator heard in every control step (V), shape (steps,).
        truth: true contraction (m), load (N) and pressure (Pa) at the ends of the control steps,
            shape (steps,) or (steps + 1,) each.
        act_seconds: computing time of every `act` (s), shape (steps,).
    """

    position: NDArray[np.float64]
    voltages: ArrayLike
    truth: Mapping[str, ArrayLike]
    act_seconds: ArrayLike


@dataclass(frozen=True)
class Figures:
    """All figures of an episode; `docs/reference/score-definitions.md` defines them.

    Attributes:
        unit: of the errors, mm or deg.
        phases: figures by phase, in the task's order.
        rmse: over the samples of all phases (unit).
        start_rmse: over the first 0.5 s (unit).
        steady_rmse: over the rest (unit).
        effort_v: standard deviation of the actuator's voltage over the trial (V).
        variation_v_per_s: total variation of the voltage a second (V/s).
        saturation_share: share of the control steps at 0 or 10 V.
        violation: how far a soft limit was passed, as a share of the way to the hard limit at which
            an episode ends; the largest of the actuator's limits, 0 within the tolerance.
        act_us: median computing time of `act` (us).
        act_us_worst: its 99th percentile (us).
    """

    unit: str
    phases: Mapping[str, PhaseFigures]
    rmse: float
    start_rmse: float
    steady_rmse: float
    effort_v: float
    variation_v_per_s: float
    saturation_share: float
    violation: float
    act_us: float
    act_us_worst: float

    def to_json(self) -> dict[str, Any]:
        """The figures as a row's fields; `json.dumps` writes its floats with all their digits."""
        phases = {name: phase._asdict() for name, phase in self.phases.items()}
        return {**asdict(self), "phases": phases}

    @classmethod
    def from_json(cls, row: Mapping[str, Any]) -> "Figures":
        """The figures of a row, which may hold other fields too.

        Raises:
            KeyError: a field is missing.
        """
        values = {field.name: row[field.name] for field in fields(cls)}
        values["phases"] = {name: PhaseFigures(**phase) for name, phase in row["phases"].items()}
        return cls(**values)


def figures(task: Task, episode: Episode, period: float, limits: Any) -> Figures:  # noqa: ANN401
    """All figures of an episode that lasted to its end.

    Args:
        task: what was to be followed.
        episode: what happened.
        period: of the control steps (s).
        limits: the rig's `[limits]` of the episode's plant: `plant.model.parameters["limits"]`.
    Returns:
        The figures, in the task's unit.
    Raises:
        ValueError: the position does not reach the end of the task, or is not finite.
    """
    errors = phase_errors(task.schedule, episode.position)
    _check_whole(task, errors)
    factor = SI_FACTORS[task.schedule.unit]
    whole = np.concatenate(list(errors.values()))
    start = round(START_S * SAMPLE_RATE_HZ)
    voltages = np.asarray(episode.voltages, dtype=np.float64)
    seconds = np.asarray(episode.act_seconds, dtype=np.float64)
    return Figures(
        unit=task.schedule.unit,
        phases={name: _phase(error, task.schedule.span, factor) for name, error in errors.items()},
        rmse=rmse(whole) / factor,
        start_rmse=rmse(whole[:start]) / factor,
        steady_rmse=rmse(whole[start:]) / factor,
        effort_v=float(np.std(voltages)),
        variation_v_per_s=float(np.abs(np.diff(voltages)).sum()) / (len(voltages) * period),
        saturation_share=float(np.isin(voltages, VOLTAGE_LIMITS).mean()),
        violation=violation(WATCHED[task.actuator], episode.truth, limits),
        act_us=float(np.median(seconds)) * 1e6,
        act_us_worst=float(np.percentile(seconds, 99.0)) * 1e6,
    )


def violation(names: Sequence[str], truth: Mapping[str, ArrayLike], limits: Any) -> float:  # noqa: ANN401
    """Compute excess over soft limits as a share of the way from soft to hard limit.

    Args:
        names: limits to look at, keys of `REACH`.
        truth: true contraction (m), load (N), pressure (Pa).
        limits: hard limits by the same names (SI).
    Returns:
        The largest share: 0 within the tolerance, 1 at the hard limit.
    """
    worst = 0.0
    for name in names:
        output, sign = SIGNALS[name]
        hard, soft = float(getattr(limits, name)), REACH[name]
        # A rig of narrower limits than this one's reach has no way between the two.
        soft = min(soft, (1.0 - TOLERANCE) * hard)
        excess = float(np.max(sign * np.asarray(truth[output], dtype=np.float64))) - soft
        if excess > TOLERANCE * hard:
            worst = max(worst, excess / (hard - soft))
    return worst


def _phase(error: NDArray[np.float64], span: float, factor: float) -> PhaseFigures:
    """Figures of a phase from its error (SI); the range in SI; SI of one unit."""
    root = rmse(error)
    return PhaseFigures(
        root / factor, percent_of_range(root, span), float(np.abs(error).max()) / factor
    )


def _check_whole(task: Task, errors: Mapping[str, NDArray[np.float64]]) -> None:
    """Refuse an episode that ended early: its figures would not be comparable."""
    for phase in task.schedule.phases:
        got = errors[phase.name].size
        if got != phase.samples:
            raise ValueError(
                f"the position must reach {task.duration:.3f} s, the end of the {task.name} task: "
                f"phase {phase.name} needs {phase.samples} samples at 384 Hz, got {got}; a trial "
                "that ended early is a failure"
            )
