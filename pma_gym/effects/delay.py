"""Dead time of commands, of bus, converter and valve, as a Pade approximation of order [2/4].

A pure delay needs past values, which a differential equation does not have. A ladder of four states
approximates it. The errors for a delay T at frequency f, with w = 2 pi f T, are

    phase       1e-7 rad at w = 0.5, 1e-5 rad at w = 1, 0.001 rad at w = 2, 0.01 rad at w = 3
    amplitude   1e-8 at w = 0.5, 4e-6 at w = 1, 8e-4 at w = 2, 0.017 at w = 3

so a delay of 20 ms is true to a part in a thousand up to 16 Hz. The price is a step: it goes the
wrong way by a tenth of itself before it comes, rises from 10 to 90 % in 0.51 T and overshoots by
5 %. Behind a lag of T it goes 2 % the wrong way. Every delay has a share: at 0 the law is absent. A
diagnosis leaves it at 1.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

ELEMENTS = (1.0 / 12.0, 3.0 / 13.0, 169.0 / 510.0, 17.0 / 39.0)
"""Time constants of the ladder over the delay, from s^4 + 12 s^3 + 72 s^2 + 240 s + 360 (Routh)."""

WEIGHTS = (3.0 / 13.0, -13.0 / 17.0, 10.0 / 13.0)
"""Weights of m_2, m_3 and m_4, for the numerator 12 s^2 - 120 s + 360."""

_SHARE = Quantity("1", 0, 1, "1 for a delay of the whole command", 0.0, usual=1)


class DriveDelay(NamedTuple):
    """Parameters of `delayed_load`."""

    share: Annotated[float, _SHARE]
    delay: Annotated[
        float, Quantity("ms", 0.001, 500, "assumption: 10, a few cycles of a controller", usual=10)
    ]


class RegulatorDelay(NamedTuple):
    """Parameters of `delayed_pressure`."""

    share: Annotated[float, _SHARE]
    delay: Annotated[
        float, Quantity("ms", 0.001, 500, "proportional regulators: 10-30 ms", usual=20)
    ]


def late(value, memory, share):
    """Return a value with a share of it late: (1 - share) v + 3/13 m_2 - 13/17 m_3 + 10/13 m_4."""
    delayed = sum(weight * state for weight, state in zip(WEIGHTS, memory[1:], strict=True))
    return (value - share * value) + delayed


def late_rate(value, memory, share, delay):
    """Rates of the ladder's states: T e_i m_i' = m_(i-1) - m_(i+1).

    For the first state, m_0 is the share of the value minus m_1. The last state has no successor.
    At rest the even states equal the share of the value and the odd ones are 0.
    """
    own = 1.0 / delay
    following = (*memory[1:], 0.0)
    before = (share * value, *memory[:-1])
    sources = [
        own * (1.0 / element) * (b - a)
        for element, b, a in zip(ELEMENTS, before, following, strict=True)
    ]
    decays = (own * (1.0 / ELEMENTS[0]), *(0.0 * own for _ in ELEMENTS[1:]))
    return tuple(zip(sources, decays, strict=True))


def delayed_load(load_asked, memory, p):
    """Load command that reaches the drive after the dead time.

        L_out = (1 - share) L + 3/13 m_2 - 13/17 m_3 + 10/13 m_4

    Args:
        load_asked: commanded load L (N).
        memory: the ladder m_1 to m_4 (N).
        p: DriveDelay: share, delay (s).
    Returns:
        Load (N).
    Source:
        Pade approximation of order [2/4] of exp(-s T) as a ladder; the module has its errors.
    """
    return late(load_asked, memory, p.share)


def delayed_load_rate(load_asked, memory, p):
    """Rates of the delay's states between the commanded load and the drive.

    Args:
        load_asked: commanded load (N).
        memory: the ladder (N).
        p: DriveDelay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (N/s).
    """
    return late_rate(load_asked, memory, p.share, p.delay)


def delayed_pressure(pressure_asked, memory, p):
    """Pressure command that reaches the regulator after the dead time.

        P_out = (1 - share) P + 3/13 m_2 - 13/17 m_3 + 10/13 m_4

    Args:
        pressure_asked: commanded gauge pressure P (Pa).
        memory: the ladder m_1 to m_4 (Pa).
        p: RegulatorDelay: share, delay (s).
    Returns:
        Gauge pressure (Pa).
    Source:
        Pade approximation of order [2/4] of exp(-s T) as a ladder; the module has its errors.
    """
    return late(pressure_asked, memory, p.share)


def delayed_pressure_rate(pressure_asked, memory, p):
    """Rates of the delay's states between the commanded pressure and the regulator.

    Args:
        pressure_asked: commanded gauge pressure (Pa).
        memory: the ladder (Pa).
        p: RegulatorDelay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (Pa/s).
    """
    return late_rate(pressure_asked, memory, p.share, p.delay)


_SIGNATURE = (
    "as late at every frequency, so its phase is proportional to frequency without end and a step "
    "begins late, where a lag begins at once; statically absent"
)

DRIVE_DELAY = Effect(
    name="drive_delay",
    port="drive_delay",
    parameters=DriveDelay,
    law=delayed_load,
    rate=delayed_load_rate,
    signature=f"load cell {_SIGNATURE}",
    memory_scale=50.0,
    memories=len(ELEMENTS),
    held=("share",),
)
REGULATOR_DELAY = Effect(
    name="regulator_delay",
    port="regulator_delay",
    parameters=RegulatorDelay,
    law=delayed_pressure,
    rate=delayed_pressure_rate,
    signature=f"measured pressure {_SIGNATURE}",
    memory_scale=100e3,
    memories=len(ELEMENTS),
    held=("share",),
)
