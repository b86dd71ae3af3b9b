"""Makers' figures of common muscles beside the scaled ones: a validation, never a fit."""

from typing import NamedTuple

import numpy as np

from pma_gym.plant.exercise_device.parallel_muscles import TESTED, muscles, scaled_force
from pma_gym.plant.model import Model
from pma_gym.plant.statics import contraction_at, muscle_force

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
