"""A load that hangs on the cable: its weight pulls, and its mass must be moved."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

GRAVITY = 9.80665
"""Standard acceleration of gravity (m/s^2)."""


class HangingLoad(NamedTuple):
    """How much of the load hangs; the plant reads it itself."""

    share: Annotated[
        float, Quantity("1", 0, 1, "1 where weights take the place of a motor", 0.0, usual=1)
    ]


def hanging_inertia(load_asked, radius, p):
    """Inertia of the weights at the pulley that they hang over.

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
