"""Somebody who pulls or pushes at the slide, beside muscle and cable."""

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

    It adds to the muscle's force at the slide, where a load is carried, so that the cable and its
    load cell feel it only as far as the slide moves.

    Args:
        memory: the hand's force f (N), written from outside as a command is.
        p: HandPush: share.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        None: our idealisation of a person at the station.
    """
    return p.share * memory


def hand_push_rate(memory, p):
    """Rate of the hand's force: none, it stays as it was written.

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
