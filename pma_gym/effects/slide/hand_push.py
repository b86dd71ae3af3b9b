"""A hand that pulls or pushes the slide, in addition to muscle and cable."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class HandPush(NamedTuple):
    """Parameters of `hand_push_force`."""

    share: Annotated[
        float,
        Quantity(
            "1", 0, 1, "1 where somebody is there; what he does is a disturbance", 0.0, usual=1
        ),
    ]


def hand_push_force(memory, p):
    """Force of a hand on the slide.

        F = share * f

    It adds to the muscle's force at the slide. It reaches the cable and the load cell only through
    the motion of the slide.

    Args:
        memory: the hand's force f (N), set from outside like a command.
        p: HandPush: share.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        None: our idealisation of a person at the station.
    """
    return p.share * memory


def hand_push_rate(memory, p):
    """Rate of the hand's force: zero, because it is set from outside.

    Args:
        memory: the hand's force (N).
        p: HandPush.
    Returns:
        (source, decay) of 0.
    """
    return 0.0 * memory, 0.0 * memory


HAND_PUSH = Effect(
    name="hand_push",
    replaces="person",
    port="slide_force",
    parameters=HandPush,
    held=("share",),
    law=hand_push_force,
    rate=hand_push_rate,
    signature="pulses of force that no command explains",
    memory_scale=50.0,
)
