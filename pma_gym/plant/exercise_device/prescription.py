"""Prescribed moments: pressures with which a device produces them, and the smallest such device."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pma_gym.plant.exercise_device.device import FULL_ANGLE, Device, pressure_grid, resistive_moment
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS

_DEG = SI_FACTORS["deg"]
_GRID = 25e3
"""Largest step between the pressures of the table behind a schedule (Pa)."""

_ROUNDING = 1e-6
"""Tolerance for rounding of a moment at the ends of the range (N m)."""


@dataclass(frozen=True)
class Miss:
    """The worst point of a prescription that a device cannot produce.

    Attributes:
        device: the device.
        angle: angle with the largest deviation (rad).
        wanted: the prescribed moment there (N m).
        low: smallest moment that a pressure gives there (N m); NaN where none is allowed.
        high: largest moment (N m).
        lowest: lowest pressure of that range (Pa).
        highest: highest pressure (Pa).
    """

    device: Device
    angle: float
    wanted: float
    low: float
    high: float
    lowest: float
    highest: float

    @property
    def distance(self) -> float:
        """Distance of the prescribed moment from the range (N m); infinite without a range."""
        outside = max(self.low - self.wanted, self.wanted - self.high)
        return outside if np.isfinite(outside) else np.inf

    def __str__(self) -> str:
        """Message with the possible moments, the angle and the fix."""
        place = f"at {self.angle / _DEG:.4g} deg"
        if not np.isfinite(self.distance):
            return (
                f"{self.wanted:g} N m {place}: no pressure of the model allows that angle on "
                f"{self.device}, the muscle would be stretched beyond its resting length; use a "
                "longer muscle or a smaller pulley"
            )
        return (
            f"moment must lie in {self.low:.2f} to {self.high:.2f} N m {place}, the range of "
            f"{self.device} at {1e-3 * self.lowest:g} to {1e-3 * self.highest:g} kPa, got "
            f"{self.wanted:g}; ask for a moment in the range, or change number, diameter or "
            "length of the muscles or the pulley"
        )


class UnreachableError(ValueError):
    """No pressure gives the prescribed moment.

    Attributes:
        miss: the worst angle, and the possible moments there.
    """

    def __init__(self, miss: Miss, among: int = 1, words: str = "") -> None:
        nearest = f" (the nearest of {among} configurations)" if among > 1 else ""
        super().__init__(words or f"{miss}{nearest}")
        self.miss = miss


class Held(NamedTuple):
    """A constant pressure (Pa) that holds a moment at 90 deg, with the cable set at it."""

    pressure: float


def hold(model: Model, device: Device, moment: float) -> Held:
    """Find the constant pressure at which a device holds a moment at 90 deg.

    The moment has its minimum near 260 kPa; of two solutions the higher pressure is returned, which
    stretches the muscle less.

    Args:
        model: model of the station.
        device: muscles and pulley.
        moment: moment at 90 deg (N m).
    Raises:
        UnreachableError: no pressure gives the moment, or none allows 90 deg.
    """
    pressure = pressure_grid(model)
    moments_by_pressure = resistive_moment(model, device, pressure, FULL_ANGLE)
    at, moments = (
        pressure[moments_by_pressure.allowed],
        moments_by_pressure.moment[moments_by_pressure.allowed],
    )
    miss = _miss(device, FULL_ANGLE, moment, at, moments)
    if miss is not None:
        raise UnreachableError(miss)
    above = moments >= moment
    for i in range(len(at) - 1, 0, -1):
        if above[i] != above[i - 1]:
            share = (moment - moments[i - 1]) / (moments[i] - moments[i - 1])
            return Held(float(at[i - 1] + share * (at[i] - at[i - 1])))
    return Held(float(at[np.argmin(np.abs(moments - moment))]))


class Schedule(NamedTuple):
    """Pressures (Pa) over the angles of a prescription; the cable is set at rest_pressure (Pa)."""

    rest_pressure: float
    pressure: NDArray[np.float64]


def follow(
    model: Model, device: Device, angle: NDArray[np.float64], moment: NDArray[np.float64]
) -> Schedule:
    """Find the pressures over angle at which a device follows a profile of moments.

    The cable's length is set once, at the lowest feasible rest pressure. A lower rest pressure
    gives more moment at small angles but stretches the muscle more at 90 deg.

    Args:
        model: model of the station.
        device: muscles and pulley.
        angle: angles of the pulley (rad), shape (n,).
        moment: prescribed moments (N m), shape (n,).
    Raises:
        UnreachableError: no rest pressure is feasible; with the worst angle at the nearest one.
    """
    pressure = pressure_grid(model, _GRID)
    misses = []
    for rest in pressure:
        schedule = _scheduled(model, device, angle, moment, float(rest), 0.0)
        if isinstance(schedule, Schedule):
            return schedule
        misses.append(schedule)
    raise UnreachableError(min(misses, key=lambda miss: miss.distance))


def follow_from(
    model: Model,
    device: Device,
    angle: NDArray[np.float64],
    moment: NDArray[np.float64],
    rest_pressure: float,
    rest_moment: float,
) -> Schedule:
    """Do as `follow` with a cable tightened to a given moment at angle 0 and a given pressure.

    Args:
        model: model of the station.
        device: muscles and pulley.
        angle: angles of the pulley (rad), shape (n,).
        moment: prescribed moments (N m), shape (n,).
        rest_pressure: gauge pressure at angle 0 (Pa).
        rest_moment: moment there (N m); 0 for a slack cable.
    Raises:
        UnreachableError: no schedule; with the worst angle and the possible moments there.
    """
    schedule = _scheduled(model, device, angle, moment, rest_pressure, rest_moment)
    if isinstance(schedule, Miss):
        raise UnreachableError(schedule)
    return schedule


def constant_moments(
    model: Model, device: Device, rest_pressure: float, step: float = 0.25
) -> tuple[float, float] | None:
    """Find the moments that a device can hold from 0 to 90 deg, with the cable set for each.

    Args:
        model: model of the station.
        device: muscles and pulley.
        rest_pressure: gauge pressure at angle 0 (Pa).
        step: step between the moments tried (N m).
    Returns:
        The smallest and the largest feasible moment of those tried (N m); None if none is feasible.
    """
    angle = FULL_ANGLE * np.linspace(0.0, 1.0, 10)
    start = float(resistive_moment(model, device, rest_pressure, FULL_ANGLE).moment)
    moments = [
        float(moment)
        for moment in np.arange(step, start, step)
        if isinstance(
            _scheduled(model, device, angle, moment + 0.0 * angle, rest_pressure, moment), Schedule
        )
    ]
    return (moments[0], moments[-1]) if moments else None


def _scheduled(
    model: Model,
    device: Device,
    angle: NDArray[np.float64],
    moment: NDArray[np.float64],
    rest_pressure: float,
    rest_moment: float,
) -> Schedule | Miss:
    """Pressures over the angle with one setting of the cable, or where it fails most."""
    pressure = pressure_grid(model, _GRID)
    columns = angle[:, None]
    result = resistive_moment(model, device, pressure, columns, rest_pressure, rest_moment)
    pressures = [
        _miss(device, a, m, pressure[ok], row[ok])
        for a, m, row, ok in zip(angle, moment, result.moment, result.allowed, strict=True)
    ]
    missed = [miss for miss in pressures if miss is not None]
    if missed:
        return max(missed, key=lambda miss: miss.distance)
    rows = zip(moment, result.moment, result.allowed, strict=True)
    read = [np.interp(m, row[ok], pressure[ok]) for m, row, ok in rows]
    return Schedule(rest_pressure, np.array(read))


def _miss(
    device: Device, angle: float, target: float, pressure: NDArray, moment: NDArray
) -> Miss | None:
    """Nothing where the moments that the pressures give have the wanted one among them."""
    if not len(moment):
        return Miss(device, angle, target, np.nan, np.nan, np.nan, np.nan)
    low, high = float(moment.min()), float(moment.max())
    if low - _ROUNDING <= target <= high + _ROUNDING:
        return None
    return Miss(device, angle, target, low, high, float(pressure[0]), float(pressure[-1]))


Answer = TypeVar("Answer")


def smallest(
    devices: Iterable[Device], attempt: Callable[[Device], Answer]
) -> tuple[Device, Answer]:
    """Find the smallest device that produces a prescription, with its pressures.

    Args:
        devices: devices to choose from, ordered by number of muscles, then diameter, length and
            radius.
        attempt: `hold` or `follow` of a prescription; raises UnreachableError where it fails.
    Raises:
        UnreachableError: no device is sufficient; with the possible moments of the nearest one.
    """
    misses = []
    for device in sorted(devices):
        try:
            return device, attempt(device)
        except UnreachableError as error:
            misses.append(error.miss)
    raise UnreachableError(min(misses, key=lambda miss: miss.distance), len(misses))
