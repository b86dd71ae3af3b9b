"""Torque of a young adult's knee as a function of angle: the reference for a device's moments."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.codegen.generic import where
from pma_gym.data.serres2008 import load_table
from pma_gym.effects.arithmetic import cosine, positive
from pma_gym.units import SI_FACTORS

STRENGTH, WIDTH, OPTIMUM = 0.163, 1.258, 1.133
"""Coefficients C1 (of body weight times height), C2 (1/rad), C3 (rad): men of 18-25 years."""

_REACH = 0.5 * math.pi / WIDTH
"""Angle from the optimum at which the knee's torque is 0 (rad)."""

BODY_MASS = 75.0
"""Mass of the young adult (kg): our assumption."""

BODY_HEIGHT = 1.78
"""Height of the young adult (m): our assumption."""

GRAVITY = 9.81
DISSERTATIONS_SHARE = 0.20
"""Ratio of the station's largest moment to the knee's: Serres 2008, 6.3, "about 20%"."""


def knee_share(angle: Any) -> Any:  # noqa: ANN401
    """Largest voluntary isometric torque of knee extension at an angle, normalised to its maximum.

        s = max(0, cos(C2 (phi - C3))),   phi = 90 deg - angle the knee's flexion

    It is 0 where the leg is over-extended by 7 deg: an operator cannot push the joint beyond.

    Args:
        angle: angle of the device (rad), a number, an array or a traced value: 0 with the knee at
            90 deg of flexion, 90 deg with the leg straight.
    Source:
        D. E. Anderson, M. L. Madigan, M. A. Nussbaum 2007, "Maximum voluntary joint torque as a
        function of joint angle and angular velocity", Journal of Biomechanics 40, 3105-3113.
        Coefficients of its table 3, knee extension. We did not have the paper; the torque muscles
        of the Rigid Body Dynamics Library (M. Millard 2016) contain the same three coefficients.
    """
    flexion = 90.0 * SI_FACTORS["deg"] - angle
    within = cosine(WIDTH * (flexion - OPTIMUM))
    # Beyond half a turn of the cosine there would be strength again.
    return positive(where(abs(flexion - OPTIMUM) < _REACH, within, 0.0))


def knee_extension_torque(
    angle: ArrayLike, mass: float = BODY_MASS, height: float = BODY_HEIGHT
) -> NDArray[np.float64]:
    """Largest voluntary isometric torque of knee extension of a young man.

        M = C1 m g h s(angle),   s as `knee_share`

    Departure: we neglect speed; at the device's 18 deg/s it would reduce the torque by about 6 %.

    Args:
        angle: angle of the device (rad), any shape.
        mass: mass of the body, m (kg).
        height: height of the body, h (m).
    Returns:
        Torque (N m), never negative.

    >>> round(float(knee_extension_torque(0.0)))
    182
    """
    return STRENGTH * mass * GRAVITY * height * knee_share(np.asarray(angle, dtype=np.float64))


def dissertations_knee_peak() -> float:
    """Largest torque of a young man's knee (N m) according to the dissertation: about 105.

    Source:
        Serres 2008, 6.3 and table 23: the station's largest moment, 20.9 N m, is "about 20%" of
        it. The dissertation prints no torque over angle. Table 23 does not follow from table I3, so
        this value is equally uncertain.
    """
    return float(load_table("23")["moment_nm"].max()) / DISSERTATIONS_SHARE
