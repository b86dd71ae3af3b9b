"""Somebody who pulls or pushes at the slide, beside muscle and cable."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Operator(NamedTuple):
    """Parameters of `operator_force`."""

    share: Annotated[
        float,
        Quantity(
            "1", 0, 1, "1 where somebody is there; what he does is a disturbance", 0.0, usual=1
        ),
    ]


def operator_force(memory, p):
    """Force of a hand on the slide.

        F = share * f

    It adds to the muscle's force at the slide, where a load is carried, so that the cable and its
    load cell feel it only as far as the slide moves.

    Args:
        memory: the hand's force f (N), written from outside as a command is.
        p: Operator: share.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        None: our idealisation of a person at the station.
    """
    return p.share * memory


def operator_rate(memory, p):
    """Rate of the hand's force: none, it stays as it was written.

    Args:
        memory: the hand's force (N).
        p: Operator.
    Returns:
        (source, decay) of 0.
    """
    return 0.0 * memory, 0.0 * memory


OPERATOR = Effect(
    name="operator",
    replaces="person",
    port="slide_force",
    parameters=Operator,
    held=("share",),
    law=operator_force,
    rate=operator_rate,
    signature="pulses of force that no command explains",
    memory_scale=50.0,
)
