"""A weight that hangs on the cable: a load with inertia."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

GRAVITY = 9.80665
"""Standard acceleration of gravity (m/s^2)."""


class HangingLoad(NamedTuple):
    """Share of the load that is a hanging weight; the plant reads it directly."""

    share: Annotated[
        float, Quantity("1", 0, 1, "1 where weights take the place of a motor", 0.0, usual=1)
    ]


def hanging_inertia(load_asked, radius, p):
    """Inertia of the hanging weights about the axis of the pulley.

        J = share r^2 L / g

    A mass M on the cable has the load L = M g and moves with the pulley's rim.

    Args:
        load_asked: weight L (N), one in a trial.
        radius: of the pulley r (m).
        p: HangingLoad: share.
    Returns:
        Inertia (kg m^2).
    """
    return p.share * radius * radius * load_asked * (1.0 / GRAVITY)


HANGING_LOAD = Effect(name="hanging_load", port="part", parameters=HangingLoad, held=("share",))
