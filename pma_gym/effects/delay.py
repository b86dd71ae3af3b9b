"""Dead time of the commands, of bus, converter and valve, as a fourth-order Bessel filter.

A pure delay needs past values, which a differential equation does not have. A ladder of four states
with the response of a Bessel filter approximates it: the delay is the same at all frequencies of
interest, there is no undershoot as with a Pade approximation, and the overshoot is 0.8 %. The
errors for a delay T at frequency f, with w = 2 pi f T, are

    phase       off by 1e-5 rad at w = 1, 0.003 rad at w = 2
    amplitude   about 1 - w^2 / 14: 1.8 % low at w = 0.5, 7 % at w = 1

so a delay of 20 ms is accurate up to about 5 Hz, faster than a muscle follows. A step rises from
10 to 90 % in 1.04 T. Every delay has a share: at 0 the law is absent. A diagnosis leaves it at 1.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

ELEMENTS = (1.0 / 10.0, 20.0 / 69.0, 1587.0 / 3430.0, 49.0 / 69.0)
"""Time constants of the ladder over the delay, from s^4 + 10 s^3 + 45 s^2 + 105 s + 105 (Routh)."""

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


def ladder(asked, memory, delay, elements=ELEMENTS):
    """Rates of the ladder's states: T e_i m_i' = m_(i-1) - m_(i+1).

    For the first state, m_0 is the command minus m_1. The last state has no successor. At rest the
    even states equal the command and the odd ones are 0.
    """
    own = 1.0 / delay
    following = (*memory[1:], 0.0)
    before = (asked, *memory[:-1])
    sources = [
        own * (1.0 / element) * (b - a)
        for element, b, a in zip(elements, before, following, strict=True)
    ]
    decays = (own * (1.0 / elements[0]), *(0.0 * own for _ in elements[1:]))
    return tuple(zip(sources, decays, strict=True))


def delayed_load(load_asked, memory, p):
    """Load command that reaches the drive after the dead time.

        L_out = (1 - share) L + m_4

    Args:
        load_asked: commanded load L (N).
        memory: the ladder m_1 to m_4 (N); m_4 is share L, one delay ago.
        p: DriveDelay: share, delay (s).
    Returns:
        Load (N).
    Source:
        Bessel's filter of fourth order (W. E. Thomson 1949) as a ladder.
    """
    return (load_asked - p.share * load_asked) + memory[-1]


def delayed_load_rate(load_asked, memory, p):
    """Rates of the delay's states between the commanded load and the drive.

    Args:
        load_asked: commanded load (N).
        memory: the ladder (N).
        p: DriveDelay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (N/s).
    """
    return ladder(p.share * load_asked, memory, p.delay)


def delayed_pressure(pressure_asked, memory, p):
    """Pressure command that reaches the regulator after the dead time.

        P_out = (1 - share) P + m_4

    Args:
        pressure_asked: commanded gauge pressure P (Pa).
        memory: the ladder m_1 to m_4 (Pa); m_4 is share P, one delay ago.
        p: RegulatorDelay: share, delay (s).
    Returns:
        Gauge pressure (Pa).
    Source:
        Bessel's filter of fourth order (W. E. Thomson 1949) as a ladder.
    """
    return (pressure_asked - p.share * pressure_asked) + memory[-1]


def delayed_pressure_rate(pressure_asked, memory, p):
    """Rates of the delay's states between the commanded pressure and the regulator.

    Args:
        pressure_asked: commanded gauge pressure (Pa).
        memory: the ladder (Pa).
        p: RegulatorDelay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (Pa/s).
    """
    return ladder(p.share * pressure_asked, memory, p.delay)


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
