"""Rate limit of the regulator: its valve passes a limited flow of air."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import where
from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

BOUNDLESS_KPA_PER_S = 1e9
"""Faster than any regulator within its bounds (an error of 10.2 MPa in 0.1 ms is 1e8 kPa/s)."""


class RegulatorRateLimit(NamedTuple):
    """Parameters of `rate_limit`."""

    limit: Annotated[
        float,
        Quantity(
            "kPa/s",
            10,
            BOUNDLESS_KPA_PER_S,
            "assumption: 2000-4000, some times the pressure in 0.22 s (Serres 2008, 2.1.2.3)",
            BOUNDLESS_KPA_PER_S,
            usual=2000,
        ),
    ]


def rate_limit(pressure, pressure_command, regulator_time_constant, p):
    """Factor that limits the regulator's rate.

        factor = min(1, limit tau / |P_command - P|)

    A different rate for venting (`regulator_asymmetry`) multiplies the limit too.

    Args:
        pressure: gauge pressure P (Pa).
        pressure_command: commanded gauge pressure (Pa).
        regulator_time_constant: tau of the regulator's lag (s).
        p: RegulatorRateLimit: limit (Pa/s).
    Returns:
        Factor.
    Source:
        Choked flow through a valve that is fully open (ISO 6358) does not depend on the
        size of the error; we take the limit as constant.
    """
    error, most = abs(pressure_command - pressure), p.limit * regulator_time_constant
    return where(error > most, most / where(error > most, error, most), 1.0)


REGULATOR_RATE_LIMIT = Effect(
    name="regulator_rate_limit",
    port="regulator_pace",
    parameters=RegulatorRateLimit,
    law=rate_limit,
    signature="straight flanks of the measured pressure after large steps, none after small ones",
)
