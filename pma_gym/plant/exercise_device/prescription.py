"""What a trainer prescribes, whether a device can give it, and the smallest one that can."""

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
"""Largest step between the pressures that a schedule is read off (Pa)."""

_ROUNDING = 1e-6
"""How far a moment may be outside the range by rounding (N m)."""


@dataclass(frozen=True)
class Miss:
    """Where a device fails a prescription.

    Attributes:
        device: the one that fails.
        angle: where it fails most (rad).
        wanted: the prescribed moment there (N m).
        low: smallest moment that a pressure gives there (N m); NaN where none is allowed.
        high: largest (N m).
        lowest: lowest pressure of that range (Pa).
        highest: highest (Pa).
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
        """How far the wanted moment is outside the range (N m); infinite without a range."""
        outside = max(self.low - self.wanted, self.wanted - self.high)
        return outside if np.isfinite(outside) else np.inf

    def __str__(self) -> str:
        """What can be given, at which angle, and the mend."""
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
    """A moment that no pressure gives.

    Attributes:
        miss: where, and what could be given there.
    """

    def __init__(self, miss: Miss, among: int = 1, words: str = "") -> None:
        nearest = f" (the nearest of {among} configurations)" if among > 1 else ""
        super().__init__(words or f"{miss}{nearest}")
        self.miss = miss


class Held(NamedTuple):
    """A moment held at 90 deg by one pressure (Pa), at which the cable was set too."""

    pressure: float


def hold(model: Model, device: Device, moment: float) -> Held:
    """The constant pressure at which a device holds a moment at 90 deg.

    The moment is least near 260 kPa; of two pressures the higher is taken, which stretches the
    muscle less.

    Args:
        model: of the station.
        device: muscles and pulley.
        moment: wanted at 90 deg (N m).
    Raises:
        UnreachableError: no pressure gives it, or none allows 90 deg.
    """
    pressure = pressure_grid(model)
    given = resistive_moment(model, device, pressure, FULL_ANGLE)
    at, moments = pressure[given.allowed], given.moment[given.allowed]
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
    """Pressures (Pa) over the angles of a prescription; the cable was set at rest_pressure (Pa)."""

    rest_pressure: float
    pressure: NDArray[np.float64]


def follow(
    model: Model, device: Device, angle: NDArray[np.float64], moment: NDArray[np.float64]
) -> Schedule:
    """Pressures over the angle at which a device gives a profile of moments.

    The cable's length is set once, at the lowest pressure of rest that serves: the lower, the more
    the muscle pulls at small angles, but the more it is stretched at 90 deg.

    Args:
        model: of the station.
        device: muscles and pulley.
        angle: of the pulley (rad), shape (n,).
        moment: wanted (N m), shape (n,).
    Raises:
        UnreachableError: no pressure of rest serves; it has the angle of the nearest one's miss.
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
    """As `follow`, of a cable that is drawn in until it holds a moment at angle 0 and a pressure.

    Args:
        model: of the station.
        device: muscles and pulley.
        angle: of the pulley (rad), shape (n,).
        moment: wanted (N m), shape (n,).
        rest_pressure: gauge pressure at angle 0 (Pa).
        rest_moment: moment there (N m); 0 for a cable that hangs slack.
    Raises:
        UnreachableError: where it fails most, and what could be given there.
    """
    schedule = _scheduled(model, device, angle, moment, rest_pressure, rest_moment)
    if isinstance(schedule, Miss):
        raise UnreachableError(schedule)
    return schedule


def constant_moments(
    model: Model, device: Device, rest_pressure: float, step: float = 0.25
) -> tuple[float, float] | None:
    """The moments that a device can hold from 0 to 90 deg, the cable drawn in for each.

    Args:
        model: of the station.
        device: muscles and pulley.
        rest_pressure: gauge pressure at angle 0 (Pa).
        step: between the moments tried (N m).
    Returns:
        The least and the greatest of those tried (N m); None if it holds none of them.
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
    given = resistive_moment(model, device, pressure, columns, rest_pressure, rest_moment)
    pressures = [
        _miss(device, a, m, pressure[ok], row[ok])
        for a, m, row, ok in zip(angle, moment, given.moment, given.allowed, strict=True)
    ]
    missed = [miss for miss in pressures if miss is not None]
    if missed:
        return max(missed, key=lambda miss: miss.distance)
    rows = zip(moment, given.moment, given.allowed, strict=True)
    read = [np.interp(m, row[ok], pressure[ok]) for m, row, ok in rows]
    return Schedule(rest_pressure, np.array(read))


def _miss(
    device: Device, angle: float, wanted: float, pressure: NDArray, moment: NDArray
) -> Miss | None:
    """Nothing where the moments that the pressures give have the wanted one among them."""
    if not len(moment):
        return Miss(device, angle, wanted, np.nan, np.nan, np.nan, np.nan)
    low, high = float(moment.min()), float(moment.max())
    if low - _ROUNDING <= wanted <= high + _ROUNDING:
        return None
    return Miss(device, angle, wanted, low, high, float(pressure[0]), float(pressure[-1]))


Answer = TypeVar("Answer")


def smallest(
    devices: Iterable[Device], attempt: Callable[[Device], Answer]
) -> tuple[Device, Answer]:
    """The smallest device that gives what is prescribed, and how.

    Args:
        devices: those to choose from; fewest muscles count first, then diameter, then length, then
            radius.
        attempt: `hold` or `follow` of a prescription; raises UnreachableError where it fails.
    Raises:
        UnreachableError: none of them gives it; says what the nearest one can.
    """
    misses = []
    for device in sorted(devices):
        try:
            return device, attempt(device)
        except UnreachableError as error:
            misses.append(error.miss)
    raise UnreachableError(min(misses, key=lambda miss: miss.distance), len(misses))
