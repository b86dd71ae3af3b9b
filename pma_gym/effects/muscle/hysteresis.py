"""Rate-independent hysteresis of bladder and braid (Bouc-Wen)."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import exponential
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Hysteresis(NamedTuple):
    """Parameters of `hysteresis_force`."""

    force: Annotated[
        float, Quantity("N", 0, 200, "literature on braided muscles: 15-40 N", 0.0, usual=25)
    ]
    distance: Annotated[
        float, Quantity("mm", 0.05, 20, "literature on braided muscles: 1-2.5 mm", usual=1.5)
    ]
    memory_at_start: Annotated[
        float,
        Quantity(
            "1", -1, 1, "1: the muscle was filled and contracted; fitted by trial", 0.0, usual=0
        ),
    ] = 0.0


def hysteresis_force(memory, p):
    """Force that opposes the recent direction of motion.

        F = -force * z

    Args:
        memory: hysteretic state z, between -1 and 1.
        p: Hysteresis: force (N), distance (m), memory_at_start (z where a trial begins).
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Bouc-Wen model with n = 1 and beta = gamma = 1/2 (Wen 1976), scaled to a force and a
        distance.
    """
    return -p.force * memory


def hysteresis_path(memory, travel, direction, p):
    """Hysteretic state after a travel of the slide without a reversal.

    It solves z' = (x' - |x'| z) / distance: z tends to the sign of the motion over the distance.

    Args:
        memory: z where the travel began.
        travel: displacement since then (m), in the direction of contraction.
        direction: 1 where the slide moves in the direction of contraction, else -1.
        p: Hysteresis.
    Returns:
        z after it.
    """
    return direction + (memory - direction) * exponential(-direction * travel / p.distance)


HYSTERESIS = Effect(
    name="hysteresis",
    port="muscle_force",
    parameters=Hysteresis,
    law=hysteresis_force,
    rate_independent_law=hysteresis_path,
    memory_start="memory_at_start",
    held=("memory_at_start",),
    signature=(
        "loops whose area does not depend on rate, with nested minor loops; the force lags behind "
        "the way over some millimetres after a turn, where dry friction turns at once"
    ),
)
