"""Five alternative laws of a braided muscle's force, from the geometry of its braid.

Threads of length b wind n turns around a cylinder of length L and diameter d. At the angle alpha
between thread and axis

    L = b cos(alpha),   d = D sin(alpha),   D = b / (pi n) the diameter at 90 deg

so that L, n and b give all quantities without an angle. The laws take the resting length L0,
the resting diameter D0 and the turns n, which can all be measured; b^2 = L0^2 + (pi n D0)^2 and
the resting angle is arctan(pi n D0 / L0). With L = L0 - x, x the contraction:

    Eq. 1 McKibben, Schulte    P times the change of volume with length
    Eq. 2 Schulz               Eq. 1, a tube that resists widening, friction
    Eq. 3 Chou, Hannaford      Eq. 1, a wall of constant thickness
    Eq. 4 Caldwell             Eq. 1, end caps that limit the smallest diameter of the tube
    Eq. 5 Tondu, Lopez         Eq. 1, contraction counted k times for the tapered ends

Each replaces contractile force and spring at its port. All but Eq. 2 are proportional to pressure,
so that without load they contract equally far at every pressure; their error against Serres 2008,
table I3, is 70-140 N. The elasticity of Eq. 2 reduces it to 25 N.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

PI = 3.141592653589793
STRAIGHT = 1e-8
"""Square of the diameter (m^2) below which a braid counts as pulled straight: 0.1 mm."""

_FIT = "least-squares fit to Serres 2008, table I3, 200-575 kPa"
_SCALE = Quantity("1", 0, 2, "1 is the published law; less where a muscle gives less", 0.0, usual=1)
_LENGTH = Quantity("mm", 10, 1000, "Serres 2008, 2.1.2.1: 250", usual=250)
_DIAMETER = Quantity("mm", 1, 100, "Serres 2008, 2.1.2.1: 20 (inner)", usual=20)


class SchulteForce(NamedTuple):
    """Parameters of `schulte_force`."""

    scale: Annotated[float, _SCALE]
    resting_length: Annotated[float, _LENGTH]
    resting_diameter: Annotated[float, _DIAMETER]
    turns: Annotated[
        float, Quantity("1", 0.1, 20, f"{_FIT}: 2.085 (27.7 deg at rest)", usual=2.085)
    ]


def schulte_force(pressure, contraction, p):
    """Force of an ideal braided muscle: pressure times the change of volume with length.

        F = scale pi D^2 P / 4 (3 cos^2(alpha) - 1) = scale P (3 L^2 - b^2) / (4 pi n^2)

    It vanishes at 54.7 deg at every pressure.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: SchulteForce: scale, resting_length L0 (m), resting_diameter D0 (m), turns n.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. H. F. Schulte 1961, who credits McKibben; Serres 2008, Eq. 1.
        2. Turns fitted to Serres 2008, table I3, 200-575 kPa: 130.6 N rms.
    """
    length = p.resting_length - contraction
    around = PI * p.turns * p.resting_diameter
    thread2 = p.resting_length * p.resting_length + around * around
    excess = 3.0 * length * length - thread2
    return p.scale * pressure * excess / (4.0 * PI * p.turns * p.turns)


class SchulzForce(NamedTuple):
    """Parameters of `schulz_force`."""

    scale: Annotated[float, _SCALE]
    resting_length: Annotated[float, _LENGTH]
    resting_diameter: Annotated[float, _DIAMETER]
    turns: Annotated[float, Quantity("1", 0.1, 20, f"{_FIT}: 1.780 (24.1 deg at rest)", usual=1.78)]
    elasticity: Annotated[
        float,
        Quantity(
            "N/mm", 0, 1000, f"{_FIT}: 3.348; modulus of the tube times its wall", usual=3.348
        ),
    ]
    shell_friction: Annotated[
        float, Quantity("1", 0, 1, f"none found: {_FIT} gives 0.002 +- 0.001", usual=0)
    ]
    tube_friction: Annotated[
        float,
        Quantity("1", 0, 1, "none found: table I3 cannot tell it from shell_friction", usual=0),
    ]


def schulz_force(pressure, contraction, p):
    """Force of a braided muscle whose tube resists widening, less friction.

        F = scale (Eq. 1 - S L0 L / (pi n^2 d) - P_c pi d L (shell + tube sin(alpha)))
        S = elasticity (d - D0) / D0        hoop tension of the tube (N/m)
        P_c = max(0, P - 2 S / d)           pressure left to press the tube against the braid

    Departures: the elastic term is not legible for certain in our copy of the source. The term here
    has the same factors and follows from the work, F dx = P dV - dW, with the hoop energy W of a
    tube of length L0. The contact pressure is never negative. Friction is subtracted as printed,
    which is valid while the muscle contracts. For friction that reverses and sticks, leave it at 0
    and add `coulomb_friction` or `hysteresis`.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: SchulzForce: scale, resting_length L0 (m), resting_diameter D0 (m), turns n, elasticity
            (N/m), shell_friction, tube_friction.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. Serres 2008, Eq. 2, after H. F. Schulte 1961 (there: Schultz).
        2. Turns and elasticity fitted to Serres 2008, table I3, 200-575 kPa: 25.2 N rms, 1.14 mm.
    """
    length = p.resting_length - contraction
    around = PI * p.turns * p.resting_diameter
    thread2 = p.resting_length * p.resting_length + around * around
    winds = PI * p.turns
    square = positive((thread2 - length * length) / (winds * winds) - STRAIGHT) + STRAIGHT
    diameter = square**0.5
    hoop = p.elasticity * (diameter - p.resting_diameter) / p.resting_diameter
    geometric = pressure * (3.0 * length * length - thread2) / (4.0 * winds * p.turns)
    elastic = hoop * p.resting_length * length / (winds * p.turns * diameter)
    sine = winds * diameter / thread2**0.5
    contact = positive(pressure - 2.0 * hoop / diameter) * PI * diameter * length
    rubbing = contact * (p.shell_friction + p.tube_friction * sine)
    return p.scale * (geometric - elastic - rubbing)


class ChouHannafordForce(NamedTuple):
    """Parameters of `chou_hannaford_force`."""

    scale: Annotated[float, _SCALE]
    resting_length: Annotated[float, _LENGTH]
    resting_diameter: Annotated[
        float,
        Quantity("mm", 1, 100, "of the braid: inner diameter 20 + 2 thickness = 22", usual=22),
    ]
    turns: Annotated[
        float, Quantity("1", 0.1, 20, f"{_FIT}: 2.012 (29.1 deg at rest)", usual=2.012)
    ]
    thickness: Annotated[
        float,
        Quantity("mm", 0, 10, f"assumption: 1 (braid and tube); {_FIT} would have 0", usual=1),
    ]


def chou_hannaford_force(pressure, contraction, p):
    """Force of a braided muscle with a wall of constant thickness t inside the braid.

        F = scale (Eq. 1 + pi P (D t (2 sin(alpha) - 1 / sin(alpha)) - t^2))

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: ChouHannafordForce: scale, resting_length (m), resting_diameter of the braid (m), turns,
            thickness t (m).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. C.-P. Chou and B. Hannaford 1996; Serres 2008, Eq. 3.
        2. Turns fitted to Serres 2008, table I3, 200-575 kPa: 136.5 N rms.
    """
    length = p.resting_length - contraction
    around = PI * p.turns * p.resting_diameter
    thread2 = p.resting_length * p.resting_length + around * around
    winds = PI * p.turns
    widest2 = thread2 / (winds * winds)
    square = positive(widest2 - length * length / (winds * winds) - STRAIGHT) + STRAIGHT
    # D sin(alpha) is the diameter d, D / sin(alpha) is D^2 / d.
    diameter = square**0.5
    wall = p.thickness * (2.0 * diameter - widest2 / diameter) - p.thickness * p.thickness
    geometric = (3.0 * length * length - thread2) / (4.0 * winds * p.turns)
    return p.scale * pressure * (geometric + PI * wall)


class CaldwellForce(NamedTuple):
    """Parameters of `caldwell_force`."""

    scale: Annotated[float, _SCALE]
    resting_length: Annotated[float, _LENGTH]
    resting_diameter: Annotated[float, _DIAMETER]
    turns: Annotated[
        float, Quantity("1", 0.1, 20, f"{_FIT}: 2.085 (27.7 deg at rest)", usual=2.085)
    ]
    cap_diameter: Annotated[
        float,
        Quantity("mm", 0, 100, "assumption: 20, plugs as wide as the resting tube", 0.0, usual=20),
    ]


def caldwell_force(pressure, contraction, p):
    """Force of a braided muscle that cannot become narrower than its end caps.

        F = scale pi P / 4 (2 D^2 cos^2(alpha) - max(d, D_cap)^2)

    Where the tube is wider than the caps this is Eq. 1, which equals Eq. 4b, and Eq. 4a written
    with the thread's length; elsewhere it is Eq. 4c.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: CaldwellForce: scale, resting_length (m), resting_diameter (m), turns, cap_diameter (m).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. N. Tsagarakis and D. G. Caldwell 2000; Serres 2008, Eq. 4a-4c.
        2. Turns fitted to Serres 2008, table I3, 200-575 kPa: 131.0 N rms.
    """
    length = p.resting_length - contraction
    around = PI * p.turns * p.resting_diameter
    thread2 = p.resting_length * p.resting_length + around * around
    winds2 = PI * p.turns * PI * p.turns
    cap2 = p.cap_diameter * p.cap_diameter
    end2 = cap2 + positive((thread2 - length * length) / winds2 - cap2)
    return p.scale * pressure * 0.25 * PI * (2.0 * length * length / winds2 - end2)


class TonduLopezForce(NamedTuple):
    """Parameters of `tondu_lopez_force`."""

    scale: Annotated[float, _SCALE]
    resting_length: Annotated[float, _LENGTH]
    resting_diameter: Annotated[float, _DIAMETER]
    turns: Annotated[
        float, Quantity("1", 0.1, 20, f"{_FIT}: 1.881 (25.3 deg at rest)", usual=1.881)
    ]
    end_factor: Annotated[
        float,
        Quantity(
            "1", 0, 5, f"{_FIT}: 1.442; 1 for a cylinder, somewhat more in practice", usual=1.442
        ),
    ]


def tondu_lopez_force(pressure, contraction, p):
    """Force of a braided muscle with tapered ends.

        F = scale pi (D0 / 2)^2 P (a (1 - k x / L0)^2 - b)
        a = 3 / tan^2(alpha0),   b = 1 / sin^2(alpha0) = 1 + a / 3

    The ends stay narrow, so that the middle contracts k times as much as x / L0.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        p: TonduLopezForce: scale, resting_length L0 (m), resting_diameter D0 (m), turns n (which
            gives tan(alpha0) = pi n D0 / L0), end_factor k.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. B. Tondu and P. Lopez 2000; Serres 2008, Eq. 5.
        2. Turns and end factor fitted to Serres 2008, table I3, 200-575 kPa: 73.5 N rms.
    """
    cotangent = p.resting_length / (PI * p.turns * p.resting_diameter)
    a = 3.0 * cotangent * cotangent
    b = 1.0 + cotangent * cotangent
    share = 1.0 - p.end_factor * contraction / p.resting_length
    area = 0.25 * PI * p.resting_diameter * p.resting_diameter
    return p.scale * pressure * area * (a * share * share - b)


_SIGNATURE = "force falls with the square of length; single-valued and independent of rate"
_PROPORTIONAL = _SIGNATURE + "; proportional to pressure"

_GEOMETRY = ("resting_length", "resting_diameter")

SCHULTE_FORCE = Effect(
    "schulte_force",
    "muscle_force",
    SchulteForce,
    schulte_force,
    signature=_PROPORTIONAL,
    held=_GEOMETRY,
    replaces="force law",
)
SCHULZ_FORCE = Effect(
    "schulz_force",
    "muscle_force",
    SchulzForce,
    schulz_force,
    signature=_SIGNATURE,
    held=_GEOMETRY,
    replaces="force law",
)
CHOU_HANNAFORD_FORCE = Effect(
    "chou_hannaford_force",
    "muscle_force",
    ChouHannafordForce,
    chou_hannaford_force,
    signature=_PROPORTIONAL,
    held=_GEOMETRY,
    replaces="force law",
)
CALDWELL_FORCE = Effect(
    "caldwell_force",
    "muscle_force",
    CaldwellForce,
    caldwell_force,
    signature=_PROPORTIONAL,
    held=_GEOMETRY,
    replaces="force law",
)
TONDU_LOPEZ_FORCE = Effect(
    "tondu_lopez_force",
    "muscle_force",
    TonduLopezForce,
    tondu_lopez_force,
    signature=_PROPORTIONAL,
    held=_GEOMETRY,
    replaces="force law",
)
