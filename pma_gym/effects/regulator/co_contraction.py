"""Two muscles commanded by the mean of their pressures and by their difference."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class CoContraction(NamedTuple):
    """Parameters of `mean_and_difference`."""

    gain: Annotated[float, Quantity("kPa/V", 1, 1000, "assumption: 80", usual=80)]
    offset: Annotated[
        float, Quantity("kPa", -5000, 5000, "assumption: -400, none at 5 V", usual=-400)
    ]


def mean_and_difference(pressure_asked, difference_voltage, p):
    """Pressures asked of two muscles, from their mean and their difference.

        P_1 = max(0, P + D / 2),   P_2 = max(0, P - D / 2),   D = gain V + offset

    Args:
        pressure_asked: mean gauge pressure P (Pa), which the first muscle's line gives.
        difference_voltage: command V of the difference (V).
        p: CoContraction: gain (Pa/V), offset (Pa).
    Returns:
        (P_1, P_2) (Pa).
    Source:
        The mean sets the stiffness of an antagonistic pair, the difference its angle.
    """
    half = 0.5 * (p.gain * difference_voltage + p.offset)
    return positive(pressure_asked + half), positive(pressure_asked - half)


CO_CONTRACTION = Effect(
    name="co_contraction",
    port="co_contraction",
    parameters=CoContraction,
    law=mean_and_difference,
    held=("gain", "offset"),
    signature="both measured pressures answer both commands",
)
