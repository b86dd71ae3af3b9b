"""A regulator of second order: its pressure begins to move with a slope of zero, and may ring."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.effects.muscle.geometric_force import PI
from pma_gym.units import Quantity


class RegulatorSecondOrder(NamedTuple):
    """Parameters of `second_order_rate`."""

    frequency: Annotated[
        float, Quantity("Hz", 0.01, 1000, "assumption: 3, proportional regulators 1-10", usual=3)
    ]
    damping: Annotated[
        float, Quantity("1", 0.05, 10, "assumption: 0.8, a step overshoots by 1.5 %", usual=0.8)
    ]

    @property
    def time_constant(self) -> float:
        """Time by which a ramp comes late (s)."""
        return self.damping / (PI * self.frequency)


def second_order_rate(memory, p):
    """Rate of the pressure, which is the effect's own state: P' = s.

    Args:
        memory: rate of the pressure s (Pa/s).
        p: RegulatorSecondOrder.
    Returns:
        (source, decay) with P' = source - decay * P.
    Source:
        Textbooks on linear systems.
    """
    return memory, 0.0 * p.damping


def second_order_acceleration(pressure, pressure_command, regulator_pace, memory, p):
    """Rate of the pressure's rate: s' = w (w (P_command - P) pace - 2 damping s).

    Args:
        pressure: gauge pressure P (Pa).
        pressure_command: commanded gauge pressure (Pa).
        regulator_pace: factor on what the error drives, 1 unless an effect changes it.
        memory: rate of the pressure s (Pa/s).
        p: RegulatorSecondOrder: frequency w / (2 pi) (Hz), damping ratio.
    Returns:
        (source, decay) with s' = source - decay * s.
    Source:
        Textbooks on linear systems.
    """
    circular = 2.0 * PI * p.frequency
    error = (pressure_command - pressure) * regulator_pace
    return circular * circular * error, 2.0 * p.damping * circular


REGULATOR_SECOND_ORDER = Effect(
    name="regulator_second_order",
    port="regulator_lag",
    parameters=RegulatorSecondOrder,
    law=second_order_rate,
    rate=second_order_acceleration,
    replaces="regulator's lag",
    memory_scale=1e6,
    signature="measured pressure begins to rise slowly after a step and may overshoot",
)
