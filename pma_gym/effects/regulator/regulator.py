"""The proportional pressure regulator: its static characteristic and its lag."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class RegulatorLine(NamedTuple):
    """Parameters of `commanded_pressure`."""

    gain: Annotated[float, Quantity("kPa/V", 1, 1000, "Serres 2008, table 1: 59.9", usual=59.9)]
    offset: Annotated[float, Quantity("kPa", -200, 200, "Serres 2008, table 1: -20.4", usual=-20.4)]


class RegulatorLag(NamedTuple):
    """Parameters of `regulator_rate`."""

    time_constant: Annotated[
        float,
        Quantity(
            "s", 1e-4, 10, "Serres 2008, 2.1.2.3: response 0.22 s, read as 10-90 %: 0.10", usual=0.1
        ),
    ]


def commanded_pressure(regulator_voltage, p):
    """Steady pressure of the regulator at a voltage, never below zero.

        P_command = max(0, gain V + offset)

    Args:
        regulator_voltage: command V (V).
        p: RegulatorLine: gain (Pa/V), offset (Pa).
    Returns:
        Gauge pressure (Pa).
    Source:
        Serres 2008, table 1.
    """
    return positive(p.gain * regulator_voltage + p.offset)


def regulator_rate(pressure_command, regulator_pace, p):
    """Rate of the pressure: tau P' = (P_command - P) pace.

    Args:
        pressure_command: commanded gauge pressure (Pa).
        regulator_pace: factor on the rate, 1 unless an effect changes it.
        p: RegulatorLag: time_constant tau (s).
    Returns:
        (source, decay) with P' = source - decay * P.
    Source:
        First order is our reading of the response time in Serres 2008, section 2.1.2.3.
    """
    decay = regulator_pace / p.time_constant
    return decay * pressure_command, decay


REGULATOR_LINE = Effect("regulator_line", "regulator_line", RegulatorLine, commanded_pressure)
REGULATOR_LAG = Effect(
    "regulator_lag",
    "regulator_lag",
    RegulatorLag,
    regulator_rate,
    signature=(
        "measured pressure late: it answers at once and approaches exponentially, its phase "
        "proportional to frequency up to 1 / (2 pi tau) and never beyond 90 deg"
    ),
)
