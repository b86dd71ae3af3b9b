"""Warm-up: a rested muscle has an extra force, which decays from trial to trial."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip, exponential
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_I3 = "Serres 2008, table I3, no-load contraction of the repeats, by the station's stiffness"

SPENT = 12.0
"""Number of decay constants after which an exponential counts as decayed: 6e-6 remains."""


class WarmUp(NamedTuple):
    """Parameters of `rested_force`."""

    force: Annotated[
        float,
        Quantity("N", -1000, 1000, f"{_I3}: 38 at 150 kPa, 170 at none", 0.0, usual=170),
    ]
    fade: Annotated[
        float, Quantity("kPa", 10, 1e5, f"{_I3}: 100, from 38, 20 and 16 N at 150-250", usual=100)
    ]
    repeats: Annotated[
        float, Quantity("1", 0.1, 1000, f"{_I3}: 0.75, from 26.4, 23.5 and 22.6 mm", usual=0.75)
    ]
    repeat: Annotated[
        float, Quantity("1", 0, 1e6, "trials since the muscle rested: 0 in the first", usual=0)
    ]


def rested_force(pressure, p):
    """Extra force of a rested muscle over a warmed-up one.

        F = force exp(-P / fade) exp(-repeat / repeats)

    It is constant within a trial: the exponent counts whole trials.

    Args:
        pressure: gauge pressure P (Pa).
        p: WarmUp: force at zero pressure (N), fade (Pa), repeats, after which 1/e remains, and
            repeat, the number of trials since the muscle rested.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Our form. In Serres 2008, table I3, the no-load contraction falls over three repeats from
        26.4 over 23.5 to 22.6 mm at 150 kPa, and by less than its scatter from 300 kPa up.
    """
    left = exponential(-clip(p.repeat / p.repeats, 0.0, SPENT))
    return p.force * left * exponential(-clip(pressure / p.fade, 0.0, SPENT))


WARM_UP = Effect(
    name="warm_up",
    port="muscle_force",
    parameters=WarmUp,
    law=rested_force,
    signature=(
        "a trend with the number of the trial: contraction falls from repeat to repeat, the more "
        "the lower the pressure, while a single trial shows nothing"
    ),
    held=("repeat",),
)
