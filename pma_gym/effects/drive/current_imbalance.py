"""The phases of a brushless motor do not get equal currents: its torque swings as it turns."""

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
        float, Quantity("deg", -180, 180, "where the motor happens to be mounted: 0", usual=0)
    ]


def imbalance_load(load_arriving, motor_angle, p):
    """Load on top of the motor's mean, by where its shaft stands.

        L = amplitude L_mean cos(periods (theta - x0 / r) + phase)

    Amplifiers of the phases whose gains differ by a share e make the torque swing by up to e, in
    proportion to the current and twice an electrical turn, so 2 to 12 times a turn of the shaft.
    Where in the turn is the shaft's own: the cable ties the shaft to the slide, so that the peaks
    stand at the same contractions at every pressure, while an angle that counts from where the
    muscle has no load (as that of `torque_ripple`) begins elsewhere at each.

    Args:
        load_arriving: mean load L_mean (N).
        motor_angle: angle of the shaft theta - x0 / r (rad) from where the cable is straight at
            the muscle's resting length.
        p: CurrentImbalance: amplitude (share), periods a turn, phase (rad).
    Returns:
        Load (N), added.
    Source:
        1. D.-W. Chung, S.-K. Sul 1998, "Analysis and compensation of current measurement error in
           vector-controlled AC motor drives", IEEE Trans. Ind. Appl. 34(2), 340-345: errors of
           scale ripple twice an electrical turn.
        2. Serres 2008, table I3: the measured load goes round the line through the voltage by
           2.7 % of itself, 5.9 times a turn; pressures left out of that fit scatter by 6 N about
           it and by 12 N about the line, the repeats by 4. The dissertation calls the motor (a
           Pacific Scientific PMA45N) a DC servo and gives no number of poles: three pairs are our
           reading.
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
