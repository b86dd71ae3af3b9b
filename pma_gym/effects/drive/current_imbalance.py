"""Unequal phase currents of a brushless motor, whose torque then varies with the shaft's angle."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import cosine
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_I3 = "Serres 2008, table I3, measured loads against the motor's voltage"


class CurrentImbalance(NamedTuple):
    """Parameters of `imbalance_load`."""

    amplitude: Annotated[float, Quantity("%", 0, 10, f"{_I3}: 2.7", 0.0, usual=2.5)]
    periods: Annotated[
        float,
        Quantity("1", 2, 12, f"{_I3}: 5.9, so 6, twice a turn of three pole pairs", usual=6),
    ]
    phase: Annotated[
        float, Quantity("deg", -360, 360, "where the motor happens to be mounted: 0", usual=0)
    ]


def imbalance_load(load_arriving, motor_angle, p):
    """Load in addition to the motor's mean load, as a function of the shaft's angle.

        L = amplitude L_mean cos(periods (theta - x0 / r) + phase)

    If the gains of the phase amplifiers differ by a share e, the torque varies by up to e. The
    variation is proportional to the current and has two periods per electrical turn, so 2 to 12
    per turn of the shaft. The phase belongs to the shaft. Because the cable ties the shaft to the
    slide, the peaks stand at the same contractions at every pressure. An angle that counts from
    the unloaded muscle (as that of `torque_ripple`) has another zero at every pressure.

    Args:
        load_arriving: mean load L_mean (N).
        motor_angle: angle of the shaft theta - x0 / r (rad) from where the cable is straight at
            the muscle's resting length.
        p: CurrentImbalance: amplitude (share), periods per turn, phase (rad).
    Returns:
        Load (N), added.
    Source:
        1. D.-W. Chung, S.-K. Sul 1998, "Analysis and compensation of current measurement error in
           vector-controlled AC motor drives", IEEE Trans. Ind. Appl. 34(2), 340-345: gain errors
           cause a ripple of two periods per electrical turn.
        2. Serres 2008, table I3: the measured load varies about the straight line in voltage
           by 2.7 %, with 5.9 periods per turn. Pressures that were left out of the fit scatter by
           6 N about it, by 12 N about the line, and repeats scatter by 4 N. The dissertation calls
           the motor (a Pacific Scientific PMA45N) a DC servo and gives no number of poles: three
           pairs are our reading.
    """
    return p.amplitude * load_arriving * cosine(p.periods * motor_angle + p.phase)


CURRENT_IMBALANCE = Effect(
    name="current_imbalance",
    port="drive_ripple",
    parameters=CurrentImbalance,
    law=imbalance_load,
    signature=(
        "load cell periodic in where the slide stands, a few times a turn of the motor, in "
        "proportion to the load and at the same places whatever the pressure"
    ),
)
