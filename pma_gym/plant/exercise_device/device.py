"""Static moment of the resistive exercise device as a function of angle, pressure and muscles.

A lever turns a pulley of radius r by theta, 0-90 deg, and winds in the cables of n muscles. With x
the contraction, x0 the one at theta = 0, F the force of all muscles (`plant.muscles`) and k the
stiffness of their cables:

    T = F(P, x) = k max(0, r theta - slack - (x0 - x)),   M = r T

Two ways to set the cable's length:

    constant pressure    x0 = x0(P), the contraction at P without a load, as in the dissertation
    scheduled pressure   x0 = x0(P_rest), set once; P then follows the angle

Hysteresis, friction, damping and weight are neglected. Each muscle has its own cable, whose
stiffness scales with the force of the muscle: our assumption, by which moments scale with n d^2.

Source:
    Serres 2008, 3.3 and 6.3; cable and pulley as `effects.cable`.

Force of parallel muscles of any diameter and length, scaled from the tested muscle's force.

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
from numpy.typing import ArrayLike, NDArray

from pma_gym.plant.model import Model
from pma_gym.plant.statics import contraction_at, muscle_force
from pma_gym.units import SI_FACTORS, Quantity

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


RADIUS = Quantity("mm", 5, 300, "Serres 2008, table I3: 25.4; model `station`: 25.89", usual=25.4)
FULL_ANGLE = 90.0 * SI_FACTORS["deg"]
"""Range of the angle, from 90 deg of knee flexion to the straight leg (Serres 2008, 4.3.1)."""

_SHORTEST, _LONGEST = -0.03, 0.09
"""Range of contractions (m) of the tested muscle in which a balance is searched."""


class Device(NamedTuple):
    """Design of a device.

    Attributes:
        muscles: the muscles on the pulley.
        radius: radius of the pulley (m).
    """

    muscles: Muscles
    radius: float

    def __str__(self) -> str:
        """Text for messages: `2 muscles of 20 mm x 250 mm on 25.9 mm`."""
        number, diameter, length = self.muscles
        name = "muscle" if number == 1 else "muscles"
        size = f"{1e3 * diameter:g} mm x {1e3 * length:g} mm"
        return f"{number} {name} of {size} on a pulley of {1e3 * self.radius:.4g} mm"


class Moments(NamedTuple):
    """Moments at the joint, with contractions and validity; arrays of one shape.

    Attributes:
        moment: moment against the operator (N m).
        contraction: contraction of the muscles from their resting length (m), negative if
            stretched.
        allowed: whether the muscles are not stretched beyond their resting length (table I3 has few
            rows there), and tension (scaled with the muscles) and pressure are within the limits.
    """

    moment: NDArray[np.float64]
    contraction: NDArray[np.float64]
    allowed: NDArray[np.bool_]


def own_device(model: Model) -> Device:
    """The dissertation's muscle on the model's pulley."""
    return Device(TESTED, model.parameters["rotor"].radius)


def pressure_grid(model: Model, step: float = 2.5e3) -> NDArray[np.float64]:
    """Evenly spaced pressures (Pa) over the model's valid range, about a step (Pa) apart."""
    ends = model.parameters["validity"]
    count = round((ends.highest - ends.lowest) / step) + 1
    return np.linspace(ends.lowest, ends.highest, count)


def resistive_moment(
    model: Model,
    device: Device,
    pressure: ArrayLike,
    angle: ArrayLike,
    rest_pressure: ArrayLike | None = None,
    rest_moment: ArrayLike = 0.0,
) -> Moments:
    """Static moment of a device at the joint.

    Args:
        model: a model whose rig is the station.
        device: muscles and pulley.
        pressure: gauge pressures (Pa), any shape.
        angle: angle of the pulley (rad), broadcast with the pressures.
        rest_pressure: gauge pressure (Pa) at which the cable length was set at angle 0; None sets
            it anew at every pressure, as in the dissertation.
        rest_moment: moment (N m) at angle 0 and the rest pressure, for which the cable was
            tightened; broadcast too. At 0 the cable is slack there.
    """
    size = device.muscles.length / TESTED.length
    force = scaled_force(muscle_force(model), device.muscles)
    set_at = pressure if rest_pressure is None else rest_pressure
    pressures, angles, rests, rest_moments = np.broadcast_arrays(
        *(np.asarray(value, dtype=np.float64) for value in (pressure, angle, set_at, rest_moment))
    )
    ends = size * _SHORTEST, size * _LONGEST
    drawn = rest_moments / device.radius
    start = contraction_at(force, rests, drawn, *ends)
    cable = model.parameters["cable"]
    stiffness = device.muscles.ratio * cable.stiffness
    slack = np.where(drawn > 0.0, -drawn / stiffness, cable.slack)
    wound = device.radius * angles - slack - start

    def unbalanced(at: np.ndarray, contraction: np.ndarray) -> np.ndarray:
        return force(at, contraction) - stiffness * np.maximum(0.0, wound + contraction)

    contraction = contraction_at(unbalanced, pressures, np.zeros_like(pressures), *ends)
    # Where the cable hangs slack the muscle stands where it has no force, to rounding.
    tension = np.where(wound + contraction > 0.0, np.maximum(0.0, force(pressures, contraction)), 0)
    allowed = _allowed(model, device, pressures, contraction, tension)
    return Moments(device.radius * tension, contraction, allowed)


def _allowed(
    model: Model, device: Device, pressure: NDArray, contraction: NDArray, tension: NDArray
) -> NDArray[np.bool_]:
    """No muscle beyond its resting length; tension and pressure within the model's limits."""
    limits = model.parameters["limits"]
    within_tension = tension <= limits.tension * device.muscles.ratio
    return (contraction >= 0.0) & within_tension & (pressure <= limits.pressure)
