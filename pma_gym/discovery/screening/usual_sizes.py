"""How large effects of a rig usually are: by the forces, ways and speeds of its trials.

A joint of a watch and one of a crane have the same effects. So an effect is looked for at a tenth
of the drive's force, and at what that makes over the speeds and ways of the trials, in place of
the sizes that the catalogue has for the station. Where the motion is imposed the force is what its
change in the trials says.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from pma_gym.data.trial import Trial
from pma_gym.discovery.screening.time_bins import SMOOTH_S
from pma_gym.discovery.thresholds import (
    FORCE_SHARE,
    RIPPLE_PERIODS,
    SLIP_DEFLECTION,
    SPEED_SHARE,
    STATIC_SHARE,
)
from pma_gym.effects.effect import signals
from pma_gym.plant import sensors
from pma_gym.plant.imposed_motion import smoothed
from pma_gym.plant.model import Model
from pma_gym.units import Quantity

LARGE = 0.9
"""Quantile of a quantity's magnitude in the trials that is its size."""

LEAST_ROWS = 8
"""Fewest readings of a trial that say how far it goes."""

PERIODIC = "1/m", "1/turn"
"""Units of how often a force repeats over the position."""

DIMENSIONS: dict[str, tuple[int, int, int, int]] = {
    "N": (1, 0, 0, 0),
    "N m": (1, 0, 0, 0),
    "N or N m": (1, 0, 0, 0),
    "N s/mm": (1, -1, 0, 0),
    "N m s": (1, -1, 0, 0),
    "N s^2/mm^2": (1, -2, 0, 0),
    "N m s^2": (1, -2, 0, 0),
    "N/mm": (1, 0, -1, 0),
    "N m/rad": (1, 0, -1, 0),
    "N/mm^3": (1, 0, -3, 0),
    "N m/rad^3": (1, 0, -3, 0),
    "N/kPa": (1, 0, 0, -1),
    "mm/s": (0, 1, 0, 0),
    "deg/s": (0, 1, 0, 0),
    **dict.fromkeys(PERIODIC, (0, 0, -1, 0)),
    "%/mm": (0, 0, -1, 0),
    "%/deg": (0, 0, -1, 0),
}
"""Powers of force, speed, way and pressure in a unit, for those that scale with them."""

RESTS = (0.0, 1.0, -1.0, 4.0, -4.0)
"""Where a spring may be relaxed, over half of the trials' longest way."""

RIPPLE = 4.0
"""Periods of a force that is periodic in the position, over half of the trials' longest way."""

CURVED = 0.2
"""What changes over half of the trials' longest way, as a share: a bent sensor's reading, or the
level of dry friction. Screening is linear in both."""

LARGEST = 0.99
"""The same of an acceleration's peaks: the last hundredth may be readings that stand alone."""


@dataclass(frozen=True)
class Sizes:
    """Sizes in trials (SI).

    Attributes:
        force: of the drive, as the model has it at rest; of an imposed motion, half its change.
        speed: of the position.
        way: half of the largest.
        pressure: of the trials; 0 where there is none.
        strongest: force of the drive and force of inertia, the largest of each; infinite where
            the rig's one inertia is not known.
    """

    force: float
    speed: float
    way: float
    pressure: float = 0.0
    strongest: float = np.inf

    def scaled(self, quantity: Quantity) -> Quantity:
        """A quantity with the usual value that the sizes make of it, within its bounds."""
        powers = DIMENSIONS.get(quantity.unit)
        if powers is None or quantity.usual is None or (powers[-1] and not self.pressure):
            return quantity
        force, speed, way, pressure = powers
        way_share = RIPPLE if quantity.unit in PERIODIC else CURVED
        share = FORCE_SHARE if force else SPEED_SHARE if speed else way_share
        size = self.force**force * self.speed**speed * self.way**way
        usual = quantity.from_si(share * size * (self.pressure**pressure if pressure else 1.0))
        least = max(quantity.lower, 0.0)
        return replace(quantity, usual=float(np.clip(usual, least, quantity.upper)))

    def least_periods(self, quantity: Quantity) -> float:
        """Least periods (file unit) that the trials' longest way tells from another law."""
        least = quantity.from_si(RIPPLE_PERIODS / (2.0 * self.way))
        return float(np.clip(least, quantity.lower, quantity.upper))

    def most_friction(self, quantity: Quantity) -> float:
        """Largest dry friction (file unit) that the trials tell from one that holds the rig."""
        most = quantity.from_si(STATIC_SHARE * self.strongest)
        return float(np.clip(most, quantity.lower, quantity.upper))

    def rests(self, quantity: Quantity) -> tuple[float, ...]:
        """Where (file unit) a spring may be relaxed: within the trials' way, and away from it."""
        way = quantity.from_si(self.way)
        return tuple(float(np.clip(each * way, quantity.lower, quantity.upper)) for each in RESTS)

    def within_way(self, quantity: Quantity) -> Quantity:
        """A length with its usual value, or with a small share of the trials' ways if that is less.

        A contact that deflects as far as its trials go never slips.
        """
        usual = quantity.usual
        assert usual is not None
        most = quantity.from_si(SLIP_DEFLECTION * self.way)
        return replace(quantity, usual=float(np.clip(min(usual, most), quantity.lower, usual)))


def sizes(model: Model, trials: Sequence[Trial]) -> Sizes | None:
    """Sizes in trials of a free rig or an imposed motion; None where they say nothing of it."""
    if model.rig.imposes_motion:
        return _imposed(model, trials)
    if not model.rig.drive_port:
        return None
    forces = [_force(model, trial) for trial in trials]
    force = _large(forces)
    read = [path for trial in trials if (path := _path(model, trial)) is not None]
    if not read:
        return None
    way = 0.5 * max(float(np.ptp(values)) for _, values in read)
    speed = _large([_speeds(*each) for each in read])
    if not min(force, speed, way) > 0.0:
        return None
    strongest = max(float(np.abs(each).max()) for each in forces)
    return Sizes(force, speed, way, strongest=strongest + _largest_inertial(model, read))


def _largest_inertial(model: Model, read: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """Largest force of inertia: what a rig that falls without a drive is moved by."""
    if not model.rig.inertia:
        return np.inf
    part, name = model.rig.inertia
    changes = [np.abs(_changes(*each)) for each in read]
    largest = max(float(np.quantile(each, LARGEST)) if each.size else 0.0 for each in changes)
    return float(getattr(model.parameters[part], name)) * largest


def _imposed(model: Model, trials: Sequence[Trial]) -> Sizes | None:
    """Of an imposed motion, whose force is what is measured."""
    _, pressures = zip(*(sensors.voltages(model, trial) for trial in trials), strict=True)
    records = [sensors.imposed_record(model, trial) for trial in trials]
    bandwidth = model.parameters["imposed_motion"].bandwidth
    moved = [
        smoothed(trial.time, record, bandwidth)
        for trial, record in zip(trials, records, strict=True)
    ]
    (force_read,) = (signal for signal in model.rig.signals if signal.is_force)
    forces = [trial.measurements.get(force_read.name, np.empty(0)) for trial in trials]
    changes = [each - np.nanmedian(each) for each in forces if np.isfinite(each).any()]
    if not changes:
        return None
    way = 0.5 * max(float(np.ptp(motion)) for motion, _, _ in moved)
    speed = _large([rate for _, rate, _ in moved])
    force = _large(changes)
    if not min(force, speed, way) > 0.0:
        return None
    line = model.parameters.get("regulator_line")
    return Sizes(force, speed, way, 0.0 if line is not None else _large(pressures))


def _path(model: Model, trial: Trial) -> tuple[np.ndarray, np.ndarray] | None:
    """Times and positions (SI) of a trial, from its speed where it has no position."""
    for signal in model.rig.signals:
        values = trial.measurements.get(signal.name)
        if values is None or np.isfinite(values).sum() < LEAST_ROWS:
            continue
        time, values = trial.time[np.isfinite(values)], values[np.isfinite(values)]
        if signal.is_position:
            return time, values
        return time, cumulative_trapezoid(values, time, initial=0.0)
    return None


def _large(parts: Sequence[np.ndarray]) -> float:
    known = np.abs(np.concatenate(parts))
    known = known[np.isfinite(known)]
    return float(np.quantile(known, LARGE)) if known.size else 0.0


def _force(model: Model, trial: Trial) -> np.ndarray:
    """Force or torque that the drive gives at rest (SI)."""
    (drive,) = (each for each in model.effects.values() if each.port == model.rig.drive_port)
    motor, _ = sensors.voltages(model, trial)
    assert drive.law is not None
    known = {"motor_voltage": motor, "command": motor, "p": model.parameters[drive.name]}
    return np.asarray(drive.law(*(known.get(name, 0.0) for name in signals(drive.law))))


def _speeds(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    rows = max(1, round(SMOOTH_S / float(np.median(np.diff(time)))))
    return (values[rows:] - values[:-rows]) / (time[rows:] - time[:-rows])


def _changes(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Rates of the speeds: accelerations."""
    speeds = _speeds(time, values)
    return _speeds(0.5 * (time[len(time) - len(speeds) :] + time[: len(speeds)]), speeds)
