"""Muscles in parallel, of other diameters and lengths, scaled from the tested one's force.

The ideal geometric law (Serres 2008, Eq. 1 and 3) makes the force of a braided muscle its cross
section times its pressure times a function of strain: braids of one angle give

    F(P, x; n, d, l) = n (d / d0)^2 F0(P, x l0 / l)

with F0 the static force of the tested muscle, of diameter d0 and length l0. Everything but the
tested muscle itself is an extrapolation: the law leaves out end caps, the wall's share of the
diameter and whatever a maker changes from size to size.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pma_gym.units import Quantity

Force = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Static force (N) by pressure (Pa) and contraction (m), as `statics.muscle_force` gives it."""

MOST = 100
"""Muscles side by side: more are a slip of the pen, an assumption."""

DIAMETER = Quantity("mm", 5, 80, "Serres 2008, 1.2.1.4: Festo has 10, 20 and 40", usual=20)
LENGTH = Quantity("mm", 40, 2000, "Serres 2008, 2.1.2.1: 250", usual=250)


class MusclesError(ValueError):
    """Muscles that cannot be; says which number, its range, the unit and the mend."""


class Muscles(NamedTuple):
    """Equal muscles side by side on one pulley.

    Attributes:
        number: how many, n.
        diameter: inner diameter at rest, d (m).
        length: length at rest, l (m).
    """

    number: int
    diameter: float
    length: float

    @property
    def ratio(self) -> float:
        """Force over the tested muscle's at the same strain and pressure: n (d / d0)^2."""
        return self.number * (self.diameter / TESTED.diameter) ** 2

    @property
    def extrapolated(self) -> bool:
        """Whether anything but the tested muscle alone."""
        return self != TESTED


TESTED = Muscles(1, 0.020, 0.250)
"""The muscle on which every station's model rests: Serres 2008, 2.1.2.1, Festo MAS-20-250N."""


def muscles(number: int, diameter_mm: float, length_mm: float) -> Muscles:
    """Muscles by the numbers that people have.

    Args:
        number: how many, side by side.
        diameter_mm: inner diameter at rest (mm).
        length_mm: length at rest (mm).
    Raises:
        MusclesError: a number out of bounds, no number, or not a whole one.

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
    """Static force of muscles scaled from the tested muscle's.

        F(P, x) = n (d / d0)^2 F0(P, x l0 / l)

    Args:
        force: of the tested muscle, F0.
        of: the muscles.
    Returns:
        Function of pressure (Pa) and contraction (m) giving the force (N) of all of them; for the
        tested muscle alone the same bits as `force`.
    Source:
        1. Serres 2008, Eq. 1 and 3, after H. F. Schulte 1961 and C.-P. Chou and B. Hannaford 1996,
           at one braid angle: a test holds it against `schulte_force`.
        2. Serres 2008, 6.3: forces of muscles in parallel add.
    """
    stretch = TESTED.length / of.length

    def scaled(pressure: np.ndarray, contraction: np.ndarray) -> np.ndarray:
        return of.ratio * force(pressure, contraction * stretch)

    return scaled
