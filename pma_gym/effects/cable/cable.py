"""The cable between pulley and slide: elastic, damped and with slack; it pulls but cannot push."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive, smoothstep
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

TIGHT_FORCE = 20.0
"""Spring force (N) at which half of the damper acts: our assumption."""


class Cable(NamedTuple):
    """Parameters of `tension`."""

    stiffness: Annotated[
        float,
        Quantity(
            "N/mm", 1, 1e7, "Serres 2008, table I3, rotation against extension: 550", usual=550
        ),
    ]
    damping: Annotated[
        float,
        Quantity("N s/mm", 0, 100, "assumption: 2 % of critical, 0.0194 at 550 N/mm", usual=0.0194),
    ]
    slack: Annotated[
        float, Quantity("mm", 0, 20, "Serres 2008, table I3: about 0.85", 0.0, usual=0.85)
    ]


def tension(stretch, stretch_rate, p):
    """Tension of the cable, which the load cell reads.

        T = max(0, F + damping s' smoothstep(F / 40 N)),   F = stiffness max(0, s - slack)

    The damping grows with the spring force. The tension therefore has no jump where the cable
    tightens; a jump would cost the integrator accuracy.

    Args:
        stretch: length of cable wound in minus the travel of the slide, s (m).
        stretch_rate: s' (m/s).
        p: Cable: stiffness (N/m), damping (N s/m), slack (m).
    Returns:
        Tension (N), never negative.
    Source:
        Our model of a cable; stiffness and slack are identified from Serres 2008, table I3.
    """
    spring = p.stiffness * positive(stretch - p.slack)
    taut = smoothstep(spring * (0.5 / TIGHT_FORCE))
    return positive(spring + taut * p.damping * stretch_rate)


def tightness(stretch, p):
    """Stretch of the cable beyond its slack; the tension has a kink where it is 0.

    Args:
        stretch: length of cable wound in minus the travel of the slide (m).
        p: Cable.
    Returns:
        Distance (m), negative while the cable is slack.
    """
    return stretch - p.slack


def full_damping(stretch, p):
    """Stretch of the cable beyond the point of full damping; the law changes form where it is 0.

    Args:
        stretch: length of cable wound in minus the travel of the slide (m).
        p: Cable.
    Returns:
        Distance (m), negative while the damping is partial.
    """
    return stretch - p.slack - 2.0 * TIGHT_FORCE / p.stiffness


CABLE = Effect(
    name="cable",
    port="cable",
    parameters=Cable,
    held=("damping",),
    law=tension,
    event=tightness,
    breakpoint=full_damping,
    signature="potentiometer minus LVDT proportional to tension; dead travel at low tension",
)
