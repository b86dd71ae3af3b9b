"""Force of parallel muscles of any diameter and length, scaled from the tested muscle's force.

In the ideal geometric law (Serres 2008, Eq. 1 and 3) the force of a braided muscle is cross section
times pressure times a function of strain. For braids of equal angle this gives

    F(P, x; n, d, l) = n (d / d0)^2 F0(P, x l0 / l)

with F0 the static force of the tested muscle, of diameter d0 and length l0. All other
muscles are extrapolations: the law neglects end caps, wall thickness and differences of design
between sizes.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pma_gym.units import Quantity

Force = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Static force (N) from pressure (Pa) and contraction (m), as `statics.muscle_force` returns it."""

MOST = 100
"""Largest number of parallel muscles, an assumption: more is probably a typing error."""

DIAMETER = Quantity("mm", 5, 80, "Serres 2008, 1.2.1.4: Festo has 10, 20 and 40", usual=20)
LENGTH = Quantity("mm", 40, 2000, "Serres 2008, 2.1.2.1: 250", usual=250)


class MusclesError(ValueError):
    """Invalid muscles; the message has the number, its range, its unit and the fix."""


class Muscles(NamedTuple):
    """Equal muscles in parallel on one pulley.

    Attributes:
        number: number of muscles, n.
        diameter: inner diameter at rest, d (m).
        length: length at rest, l (m).
    """

    number: int
    diameter: float
    length: float

    @property
    def ratio(self) -> float:
        """Ratio of the force to the tested muscle's at equal strain and pressure: n (d / d0)^2."""
        return self.number * (self.diameter / TESTED.diameter) ** 2

    @property
    def extrapolated(self) -> bool:
        """Whether the muscles differ from the single tested muscle."""
        return self != TESTED


TESTED = Muscles(1, 0.020, 0.250)
"""The tested muscle, basis of every station model: Serres 2008, 2.1.2.1, Festo MAS-20-250N."""


def muscles(number: int, diameter_mm: float, length_mm: float) -> Muscles:
    """Make muscles from their number and their size in mm.

    Args:
        number: number of parallel muscles.
        diameter_mm: inner diameter at rest (mm).
        length_mm: length at rest (mm).
    Raises:
        MusclesError: a value out of bounds or not a number, or a number that is not whole.

    >>> muscles(2, 40, 250).ratio
    8.0
    """
    if number not in range(1, MOST + 1):
        raise MusclesError(
            f"muscles must be a whole number in 1 to {MOST}, got {number!r}; give how many there "
            "are side by side on the pulley"
        )
    try:
        DIAMETER.check("diameter", diameter_mm)
        LENGTH.check("length", length_mm)
    except ValueError as error:
        raise MusclesError(str(error)) from None
    return Muscles(int(number), DIAMETER.to_si(diameter_mm), LENGTH.to_si(length_mm))


def scaled_force(force: Force, of: Muscles) -> Force:
    """Scale the static force of the tested muscle to other muscles.

        F(P, x) = n (d / d0)^2 F0(P, x l0 / l)

    Args:
        force: force of the tested muscle, F0.
        of: the muscles.
    Returns:
        Function of pressure (Pa) and contraction (m) that returns the force (N) of all muscles;
        bit-identical to `force` for the single tested muscle.
    Source:
        1. Serres 2008, Eq. 1 and 3, after H. F. Schulte 1961 and C.-P. Chou and B. Hannaford 1996,
           at one braid angle; a test compares it with `schulte_force`.
        2. Serres 2008, 6.3: forces of muscles in parallel add.
    """
    stretch = TESTED.length / of.length

    def scaled(pressure: np.ndarray, contraction: np.ndarray) -> np.ndarray:
        return of.ratio * force(pressure, contraction * stretch)

    return scaled
