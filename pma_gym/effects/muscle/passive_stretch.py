"""Stiffening of bladder and braid beyond the resting length."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive, where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

TERMS = (80.0 + 2.0 / 3.0, 14.0 + 7.0 / 12.0, 1.0 / 3.0, 5.0 / 12.0)
"""Factors (N) of s to s^4, s in percent: a quartic through 0, 96, 229, 416, 684 N at 0 to 4 %."""


class PassiveStretch(NamedTuple):
    """Parameters of `stretch_force`."""

    factor: Annotated[
        float,
        Quantity(
            "1",
            0,
            3,
            "1 for 96, 229, 416, 684 N at 1-4 %, an assumption for a MAS-20",
            0.0,
            usual=1,
        ),
    ]
    resting_length: Annotated[
        float, Quantity("mm", 10, 5000, "Serres 2008, 2.1.2.1: 250", usual=250)
    ]


def stretch_force(contraction, p):
    """Force of the passive material, which acts only beyond the resting length.

        F = factor (80.67 s + 14.58 s^2 + 0.333 s^3 + 0.417 s^4) N,   s = 100 max(0, -x) / L0

    It adds to the force law. A force law that stiffens there, such as `sarosi_force`, already
    contains part of it.

    Args:
        contraction: shortening x from the resting length (m).
        p: PassiveStretch: factor, resting_length L0 (m).
    Returns:
        Force (N), not negative; positive shortens the muscle.
    Source:
        Our quartic through 96, 229, 416 and 684 N at 1, 2, 3 and 4 %, figures for an
        unpressurised muscle of this kind. Serres 2008 does not print them: an assumption. All terms
        are positive, so the force rises ever more steeply.
    """
    percent = positive(-contraction) * (100.0 / p.resting_length)
    first, second, third, fourth = TERMS
    curve = percent * (first + percent * (second + percent * (third + percent * fourth)))
    return p.factor * curve


def slackness(contraction, p):
    """Distance of the material from being stretched; the force has a kink at 0.

    Args:
        contraction: shortening x from the resting length (m).
        p: PassiveStretch.
    Returns:
        Distance (m), negative while stretched; never negative for a factor of 0, so without a kink.
    """
    return where(p.factor * contraction < 0.0, contraction, abs(contraction))


PASSIVE_STRETCH = Effect(
    name="passive_stretch",
    port="muscle_force",
    parameters=PassiveStretch,
    held=("resting_length",),
    law=stretch_force,
    event=slackness,
    signature="force misfit at negative contraction only, single-valued",
)
