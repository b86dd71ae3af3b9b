"""Backlash: lost motion between the drive and the parts that rub."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Backlash(NamedTuple):
    """Parameters of `lost_motion`."""

    width: Annotated[float, Quantity("mm", 0, 1000, "assumption: 1", 0.0, usual=1)]


def lost_motion(memory, travel, p):
    """Position in the gap after a travel without resistance.

        b = clip(b + travel, -width / 2, width / 2)

    The rubbing parts stand still while the drive crosses the gap. When the drive reverses, their
    bristles relax first: `travel` counts from the point where they exert no force, so that no
    friction is measured in the gap.

    Args:
        memory: position b in the gap where the travel began (m), from its middle.
        travel: displacement since the bristles relaxed (m), in the direction of contraction.
        p: Backlash: width (m), from stop to stop.
    Returns:
        Position in the gap (m).
    Source:
        Play between two stops in line with a friction element without mass.
    """
    half = 0.5 * p.width
    return clip(memory + travel, -half, half)


BACKLASH = Effect(
    name="backlash",
    port="lost_motion",
    parameters=Backlash,
    rate_independent_law=lost_motion,
    signature=(
        "after every reversal no force over the same way, at every amplitude and speed, before "
        "friction comes back in the other direction"
    ),
    memory_scale=1e-3,
)
