"""Backlash (play) between the pulley and its potentiometer."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class PotentiometerBacklash(NamedTuple):
    """Parameters of `play`."""

    width: Annotated[
        float, Quantity("deg", 0, 20, "assumption: 1-6 for a coupling or gear", 0.0, usual=2)
    ]


def play(memory, p):
    """Error of the measured angle by the play.

        error = -width / 2 z

    Args:
        memory: position z in the play, -1 at one stop to 1 at the other.
        p: PotentiometerBacklash: width (rad), from stop to stop.
    Returns:
        Error (rad), added to the true value.
    Source:
        Stop operator, rounded as by Bouc and Wen (Y. K. Wen 1976).
    """
    return -0.5 * p.width * memory


def play_rate(spin, memory, p):
    """Rate of the position in the play.

        z' = 2 theta' / width (1 - |z|^4)   towards a stop
        z' = 2 theta' / width               away from it

    After a reversal the measurement stays constant over the width, then follows within a quarter of
    the width; it never moves backwards. At a width of 0 z stays exactly 0.

    Args:
        spin: rate of the pulley's angle theta' (rad/s).
        memory: position z.
        p: PotentiometerBacklash.
    Returns:
        (source, decay) with z' = source - decay * z (1/s).
    """
    pace = where(p.width > 0.0, 2.0 / where(p.width > 0.0, p.width, 1.0), 0.0) * spin
    square = memory * memory
    return pace, where(pace * memory > 0.0, abs(pace * memory) * square, 0.0)


def play_turn(spin, p):
    """Event function: the play's law changes form where the pulley reverses.

    Args:
        spin: rate of the pulley's angle (rad/s).
        p: PotentiometerBacklash.
    Returns:
        The rate (rad/s); 1 where there is no play.
    """
    there = where(p.width > 0.0, 1.0, 0.0)
    return there * spin + (1.0 - there)


POTENTIOMETER_BACKLASH = Effect(
    name="potentiometer_backlash",
    port="sensor:rotation",
    parameters=PotentiometerBacklash,
    law=play,
    rate=play_rate,
    breakpoint=play_turn,
    signature=(
        "measured rotation stands still after every turn, over the same angle at every load and "
        "rate, while LVDT and load cell go on"
    ),
    memory_scale=1.0,
)
