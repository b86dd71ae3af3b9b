"""Dead time of the commands: bus, converter and valve answer only after a while.

A true delay needs the past; an equation of motion has none. In its place stands the ladder of four
memories that answers like Bessel's filter: its delay is the same at all frequencies that matter,
it does not undershoot as Pade's approximation does, and overshoots by 0.8 %. For a delay T it has
at frequency f, with w = 2 pi f T,

    phase       off by 1e-5 rad at w = 1, 0.003 rad at w = 2
    amplitude   about 1 - w^2 / 14: 1.8 % low at w = 0.5, 7 % at w = 1

so a delay of 20 ms is good up to some 5 Hz, beyond what a muscle follows. A step's edge takes
1.04 T from 10 to 90 %. Every delay comes with a share, which a diagnosis leaves at 1: the law is
absent at 0.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

ELEMENTS = (1.0 / 10.0, 20.0 / 69.0, 1587.0 / 3430.0, 49.0 / 69.0)
"""Time constants of the ladder by the delay, from s^4 + 10 s^3 + 45 s^2 + 105 s + 105 (Routh)."""

_SHARE = Quantity("1", 0, 1, "1 for a delay of the whole command", 0.0, usual=1)


class DriveDelay(NamedTuple):
    """Parameters of `delayed_load`."""

    share: Annotated[float, _SHARE]
    delay: Annotated[
        float, Quantity("ms", 0.1, 500, "assumption: 10, a few cycles of a controller", usual=10)
    ]


class RegulatorDelay(NamedTuple):
    """Parameters of `delayed_pressure`."""

    share: Annotated[float, _SHARE]
    delay: Annotated[float, Quantity("ms", 0.1, 500, "proportional regulators: 10-30 ms", usual=20)]


def ladder(asked, memory, delay):
    """Rates of the ladder's memories: T e_i m_i' = m_(i-1) - m_(i+1).

    The first one's neighbour before is what is asked for, less itself; the last has none after it
    and is what comes out. At rest the even ones are what is asked for, the odd ones 0.
    """
    own = 1.0 / delay
    following = (*memory[1:], 0.0)
    before = (asked, *memory[:-1])
    sources = [
        own * (1.0 / element) * (b - a)
        for element, b, a in zip(ELEMENTS, before, following, strict=True)
    ]
    decays = (own * (1.0 / ELEMENTS[0]), *(0.0 * own for _ in ELEMENTS[1:]))
    return tuple(zip(sources, decays, strict=True))


def delayed_load(load_asked, memory, p):
    """Load that the drive has heard of.

        L_out = (1 - share) L + m_4

    Args:
        load_asked: load L that is asked of the drive (N).
        memory: the ladder m_1 to m_4 (N); m_4 is share L, one delay ago.
        p: DriveDelay: share, delay (s).
    Returns:
        Load (N).
    Source:
        Bessel's filter of fourth order (W. E. Thomson 1949) as a ladder.
    """
    return (load_asked - p.share * load_asked) + memory[-1]


def delayed_load_rate(load_asked, memory, p):
    """Rates of the memories between the load that is asked for and the drive.

    Args:
        load_asked: load that is asked of the drive (N).
        memory: the ladder (N).
        p: DriveDelay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (N/s).
    """
    return ladder(p.share * load_asked, memory, p.delay)


def delayed_pressure(pressure_asked, memory, p):
    """Pressure that the regulator has heard of.

        P_out = (1 - share) P + m_4

    Args:
        pressure_asked: gauge pressure P that is asked of the regulator (Pa).
        memory: the ladder m_1 to m_4 (Pa); m_4 is share P, one delay ago.
        p: RegulatorDelay: share, delay (s).
    Returns:
        Gauge pressure (Pa).
    Source:
        Bessel's filter of fourth order (W. E. Thomson 1949) as a ladder.
    """
    return (pressure_asked - p.share * pressure_asked) + memory[-1]


def delayed_pressure_rate(pressure_asked, memory, p):
    """Rates of the memories between the pressure that is asked for and the regulator.

    Args:
        pressure_asked: gauge pressure that is asked of the regulator (Pa).
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
