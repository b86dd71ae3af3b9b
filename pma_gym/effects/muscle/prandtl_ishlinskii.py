"""Hysteresis that differs by direction: a sum of stop operators (Prandtl and Ishlinskii).

Each operator is an elastic element that slips at a force, which may be another as the muscle
relaxes. Three of different distances make a curve that bends as often.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class StopOperator(NamedTuple):
    """Parameters of `stop_force`."""

    force: Annotated[
        float, Quantity("N", 0, 1000, "assumption: 10, of 15-40 in all", 0.0, usual=10)
    ]
    release_ratio: Annotated[
        float, Quantity("1", 0, 10, "1 where both directions are alike", usual=1)
    ]
    distance: Annotated[
        float, Quantity("mm", 0.01, 100, "assumption: 1, and 0.3 and 3 for others", usual=1)
    ]
    memory_at_start: Annotated[
        float, Quantity("1", -1, 1, "1: the muscle has contracted; 0 for no history", usual=0)
    ]


def stop_force(memory, p):
    """Force of the operator, against the recent motion.

        F = -force z

    Args:
        memory: deflection z, from -release_ratio to 1.
        p: StopOperator: force (N) at which it slips as the muscle contracts.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        1. L. Prandtl 1928; A. Y. Ishlinskii 1944: sums of elastic elements that slip.
        2. M. Al Janaideh, S. Rakheja and C.-Y. Su 2009, Smart Materials and Structures 18:
           operators that differ by direction; here the force at which they slip does.
    """
    return -p.force * memory


def stop_path(memory, travel, direction, p):
    """Deflection after a travel without a reversal: elastic, then slipping.

        z = clip(z_0 + travel / distance, -release_ratio, 1)

    Args:
        memory: z_0 where the travel began.
        travel: displacement since then (m), in the direction of contraction.
        direction: 1 where the muscle contracts, else -1.
        p: StopOperator: distance (m), release_ratio.
    Returns:
        z after it.
    """
    limit = where(direction > 0.0, 1.0, p.release_ratio)
    return direction * clip(direction * (memory + travel / p.distance), -20.0, limit)


def stop_breakpoint(memory, direction, p):
    """Distance to where the operator slips.

    Args:
        memory: z where the travel begins.
        direction: 1 where the muscle contracts, else -1.
        p: StopOperator.
    Returns:
        Distance (m), 0 where it slips or has no force.
    """
    limit = where(direction > 0.0, 1.0, p.release_ratio)
    return where(p.force > 0.0, p.distance, 0.0) * (limit - direction * memory)


STOP_OPERATORS = tuple(
    Effect(
        name=name,
        port="muscle_force",
        parameters=StopOperator,
        law=stop_force,
        rate_independent_law=stop_path,
        path_breakpoint=stop_breakpoint,
        memory_start="memory_at_start",
        held=("memory_at_start",),
        replaces="hysteresis",
        signature="loops with corners, whose halves differ by direction",
    )
    for name in ("stop_operator", "stop_operator_2", "stop_operator_3")
)
