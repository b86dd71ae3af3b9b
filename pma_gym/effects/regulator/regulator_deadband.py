"""Deadband of the regulator: it does not correct small pressure errors."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class RegulatorDeadband(NamedTuple):
    """Parameters of `deadband`."""

    width: Annotated[
        float,
        Quantity("kPa", 0, 100, "data sheets of proportional regulators: 1-5", 0.0, usual=3),
    ]


def deadband(pressure, pressure_command, p):
    """Factor on the regulator's rate that stops the pressure short of the command.

        factor = max(0, 1 - width / |P_command - P|)

    so that the pressure comes to rest one width below the command when it rises, and one width
    above when it falls. A trial begins at the command.

    Args:
        pressure: gauge pressure P (Pa).
        pressure_command: commanded gauge pressure (Pa).
        p: RegulatorDeadband: width (Pa), to one side.
    Returns:
        Factor, 0 to 1.
    Source:
        Our form: beyond the deadband the valve opens in proportion to the error.
    """
    error = abs(pressure_command - pressure)
    beyond = error > p.width
    within = where(p.width > 0.0, 0.0, 1.0)
    return where(beyond, 1.0 - p.width / where(beyond, error, 1.0), within)


REGULATOR_DEADBAND = Effect(
    name="regulator_deadband",
    port="regulator_pace",
    parameters=RegulatorDeadband,
    law=deadband,
    signature=(
        "measured pressure rests short of its command, on the side that it came from, and answers "
        "no step smaller than that"
    ),
)
