"""The range of moments that a device can give, at constant and at scheduled pressure.

Makers' figures of common muscles beside the scaled ones: a validation, never a fit.
"""

from typing import NamedTuple

import numpy as np

from pma_gym.data.serres2008 import load_table
from pma_gym.plant.exercise_device.device import (
    FULL_ANGLE,
    TESTED,
    Device,
    muscles,
    own_device,
    pressure_grid,
    resistive_moment,
    scaled_force,
)
from pma_gym.plant.model import Model
from pma_gym.plant.statics import contraction_at, muscle_force
from pma_gym.studies.station_limits import load_at_rotation
from pma_gym.units import SI_FACTORS

_KPA = SI_FACTORS["kPa"]


class Span(NamedTuple):
    """Range of moments that a device can hold at an angle, over its pressures.

    Attributes:
        low: smallest moment (N m).
        high: largest (N m).
        lowest: lowest pressure that the angle allows (Pa).
        highest: highest (Pa).
    """

    low: float
    high: float
    lowest: float
    highest: float


def span(
    model: Model, device: Device, angle: float = FULL_ANGLE, rest_pressure: float | None = None
) -> Span | None:
    """Moments at an angle that the pressures of the model's validity give.

    Args:
        model: of the station.
        device: muscles and pulley.
        angle: of the pulley (rad).
        rest_pressure: at which the cable was set (Pa); None sets it anew at every pressure: the
            constant pressure of the dissertation.
    Returns:
        The span; None where no pressure allows the angle: the muscle is too short for the pulley.
    """
    pressure = pressure_grid(model)
    result = resistive_moment(model, device, pressure, angle, rest_pressure)
    if not result.allowed.any():
        return None
    moment, usable = result.moment[result.allowed], pressure[result.allowed]
    return Span(float(moment.min()), float(moment.max()), float(usable[0]), float(usable[-1]))


def lowest_rest_pressure(model: Model, device: Device, step: float = 25e3) -> float | None:
    """Lowest pressure (Pa) at which a cable can be set so that 90 deg is allowed at any pressure.

    The lower it is, the more the muscles pull at small angles, and the further 90 deg pulls them.

    Args:
        model: of the station.
        device: muscles and pulley.
        step: between the pressures tried (Pa).
    Returns:
        The pressure; None if none of the model's validity serves.
    """
    rests = pressure_grid(model, step)
    result = resistive_moment(model, device, rests[None, :], FULL_ANGLE, rests[:, None])
    serving = rests[result.allowed.all(axis=1)]
    return float(serving[0]) if len(serving) else None


class MomentCheck(NamedTuple):
    """The tested muscle's moment at 90 deg beside table I3 and table 23.

    Attributes:
        pressure: gauge pressure (Pa).
        ours: static moment of the model (N m).
        measured: load cell of table I3 at 90 deg times the model's pulley radius (N m).
        printed: table 23's (N m), which does not follow from table I3: no truth.
    """

    pressure: float
    ours: float
    measured: float
    printed: float

    @property
    def percent(self) -> float:
        """Ours over the measured one, less 100 %."""
        return 100.0 * (self.ours / self.measured - 1.0)


def check_moments(model: Model) -> list[MomentCheck]:
    """The tested muscle's moment at 90 deg beside load cell times radius, at table 23's pressures.

    Table I3 at a pressure has twelve loads in three repeats. Of the three, the loads that the cell
    read and the rotations (from where the pulley stood without a load) are averaged, a lost figure
    left out; the load is read off at 90 deg on the line between the two neighbours. The radius is
    the model's, as identified from the same table; it multiplies both sides. The model was fitted
    to table I3, so this is consistency, no proof on data that it has not seen.

    Args:
        model: of the station.

    Source:
        Serres 2008, tables I3 and 23.
    """
    device, table = own_device(model), load_table("23")
    ours = resistive_moment(model, device, _KPA * table["pressure_kpa"], FULL_ANGLE).moment
    rows = zip(table["pressure_kpa"], ours, table["moment_nm"], strict=True)
    return [
        MomentCheck(
            float(_KPA * pressure),
            float(moment),
            device.radius * load_at_rotation(float(pressure)),
            float(printed),
        )
        for pressure, moment, printed in rows
    ]


RATED_PRESSURE = 600e3
"""Of 20 and 40 mm (Pa): Serres 2008, 1.2.1.4 and 2.1.2.1; 25 kPa above the model's validity."""

_CATALOGUE = "assumption: maker's catalogue, not checked here"


class Figure(NamedTuple):
    """A maker's figure and ours.

    Attributes:
        what: in words, with unit.
        maker: the maker's.
        ours: scaled from the tested muscle.
        source: of the maker's.
    """

    what: str
    maker: float
    ours: float
    source: str

    @property
    def percent(self) -> float:
        """Ours over the maker's, less 100 %."""
        return 100.0 * (self.ours / self.maker - 1.0)


def makers_figures(model: Model) -> list[Figure]:
    """Largest forces and contractions of 10, 20 and 40 mm beside what the scaling gives.

    Args:
        model: of the station.
    """
    by_diameter = {diameter: _force_at_rest(model, diameter) for diameter in (10, 20, 40)}
    at = "at its resting length (N)"
    return [
        Figure(f"force of 10 mm {at}", 630.0 * 6 / 8, by_diameter[10], f"630 N at 8 bar: {_OF_10}"),
        Figure(f"force of 20 mm {at}", 1200.0, by_diameter[20], "Serres 2008, 2.1.2.1: at least"),
        Figure(f"force of 20 mm {at}", 1500.0, by_diameter[20], _CATALOGUE),
        Figure(f"force of 40 mm {at}", 6000.0, by_diameter[40], "Serres 2008, 1.2.1.4"),
        Figure("contraction without load (%)", 25.0, _free_percent(model), "Serres 2008, 1.2.1.4"),
    ]


_OF_10 = f"{_CATALOGUE}; taken to 600 kPa in proportion to pressure"


def _force_at_rest(model: Model, diameter_mm: float) -> float:
    force = scaled_force(muscle_force(model), muscles(1, diameter_mm, 250))
    return float(force(np.array([RATED_PRESSURE]), np.zeros(1))[0])


def _free_percent(model: Model) -> float:
    """Contraction without load at the rated pressure (%), the same for all sizes."""
    free = contraction_at(muscle_force(model), np.array([RATED_PRESSURE]), np.zeros(1))
    return 100.0 * float(free[0]) / TESTED.length
