"""Asymmetry of the regulator: venting and filling have different time constants."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity


class RegulatorAsymmetry(NamedTuple):
    """Parameters of `regulator_asymmetry`."""

    vent_ratio: Annotated[
        float,
        Quantity(
            "1",
            0.01,
            100,
            "Serres 2008, 6.1: filling and venting differ; 1.5 is an assumption",
            1.0,
            usual=1.5,
        ),
    ]


def regulator_asymmetry(pressure, pressure_command, p):
    """Factor on the regulator's rate: 1 while it fills, 1 / vent_ratio while it vents.

    Args:
        pressure: gauge pressure (Pa).
        pressure_command: commanded gauge pressure (Pa).
        p: RegulatorAsymmetry: vent_ratio, time constant of venting over that of filling.
    Returns:
        Factor.
    Source:
        Serres 2008, section 6.1, reports that filling and venting differ.
    """
    return where(pressure_command < pressure, 1.0 / p.vent_ratio, 1.0)


REGULATOR_ASYMMETRY = Effect(
    name="regulator_asymmetry",
    port="regulator_pace",
    parameters=RegulatorAsymmetry,
    law=regulator_asymmetry,
    signature="measured pressure later in one direction than in the other",
)
