"""A leg on the lever of the pulley: its inertia and the damping of the knee."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Leg(NamedTuple):
    """Shank, foot and lever, which turn with the pulley; the plant reads them directly."""

    inertia: Annotated[
        float,
        Quantity(
            "kg m^2",
            0,
            5,
            "D. A. Winter 2009, table 4.1 (after Dempster): shank and foot 0.061 of the mass, "
            "gyration about the knee 0.735 of a shank of 0.246 of the height: 0.47 at 75 kg and "
            "1.78 m, 0.42 after P. de Leva 1996; 0.45 lies between. Coefficients as another "
            "library has them; the length is from memory",
            0.0,
            usual=0.45,
        ),
    ]
    damping: Annotated[
        float,
        Quantity(
            "N m s",
            0,
            20,
            "assumption: 1, a damping ratio of some 0.2 about the knee",
            0.0,
            usual=1.0,
        ),
    ]


def leg_torque(spin, p):
    """Torque of the knee's damping on the pulley.

        M = damping theta'

    Args:
        spin: rate of the pulley's angle theta' (rad/s).
        p: Leg: damping (N m s).
    Returns:
        Torque (N m), positive against winding in.
    Source:
        Our model: one viscous coefficient for the joint, and no gravity, as in space.
    """
    return p.damping * spin


LEG = Effect(name="leg", port="part", parameters=Leg, held=("inertia", "damping"))
