"""The cable between pulley and slide: it pulls, it gives, it has slack; it cannot push."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class Cable(NamedTuple):
    """Parameters of `tension`."""

    stiffness: Annotated[
        float, Quantity("N/mm", 1, 1e7, "Serres 2008, table I3, rotation against extension: 550")
    ]
    damping: Annotated[
        float, Quantity("N s/mm", 0, 100, "assumption: 2 % of critical, 0.0194 at 550 N/mm")
    ]
    slack: Annotated[float, Quantity("mm", 0, 20, "Serres 2008, table I3: about 0.85", 0.0)]


def tension(stretch, stretch_rate, p):
    """Tension of the cable, which the load cell reads.

        T = max(0, stiffness (s - slack) + damping s')   while s > slack, else 0

    Args:
        stretch: cable wound in less the way of the slide, s (m).
        stretch_rate: s' (m/s).
        p: Cable: stiffness (N/m), damping (N s/m), slack (m).
    Returns:
        Tension (N), never negative.
    Source:
        Our model of a cable; stiffness and slack are identified from Serres 2008, table I3.
    """
    beyond = stretch - p.slack
    # The damper acts in full only once the cable is 1 um tight, so that tightening has no jump.
    taut = positive(beyond) / (abs(beyond) + 1e-6)
    return positive(p.stiffness * positive(beyond) + taut * p.damping * stretch_rate)


CABLE = Effect(
    name="cable",
    port="cable",
    parameters=Cable,
    law=tension,
    signature="potentiometer minus LVDT proportional to tension; dead travel at low tension",
)
