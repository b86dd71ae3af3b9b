"""Valves that fill and vent a muscle: flow, spool, pressure loop, pulses, and the tube's delay."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import clip, cosine, maximum, minimum, positive, where
from pma_gym.effects.delay import late, late_rate
from pma_gym.effects.effect import Effect
from pma_gym.effects.muscle.geometric_force import PI
from pma_gym.effects.regulator.filling import ATMOSPHERE
from pma_gym.units import Quantity

DENSITY, HEAT = 1.185, 287.0 * 293.15
"""Density of air at the reference of ISO 6358 (kg/m^3); gas constant times temperature (J/kg)."""

NEARLY_EQUAL = 0.999
"""Pressure ratio from which the flow is linear in the difference: its slope would be infinite."""

_CONDUCTANCE = Quantity(
    "l/min/bar", 0, 1e5, "data sheets of small valves: 20-200; assumption: 60", usual=60
)
_RATIO = Quantity("1", 0.01, 0.9, "ISO 6358, data sheets: 0.2-0.5", usual=0.3)


class Valve(NamedTuple):
    """Parameters of `valve_flow`."""

    filling: Annotated[float, _CONDUCTANCE]
    venting: Annotated[float, _CONDUCTANCE]
    critical_ratio: Annotated[float, _RATIO]


class ValveSpool(NamedTuple):
    """Parameters of `spool_opening`."""

    middle: Annotated[float, Quantity("V", -10, 10, "assumption: 0, shut", usual=0)]
    span: Annotated[float, Quantity("V", 0.1, 20, "assumption: 10, from shut to open", usual=10)]


class PressureLoop(NamedTuple):
    """Parameters of `loop_opening`."""

    gain: Annotated[
        float,
        Quantity("1/kPa", 1e-4, 10, "assumption: 0.02, open at an error of 50 kPa", usual=0.02),
    ]


class PulseWidth(NamedTuple):
    """Parameters of `mean_opening`."""

    frequency: Annotated[float, Quantity("Hz", 1, 1000, "assumption: 50", usual=50)]
    opening_time: Annotated[
        float, Quantity("ms", 0, 100, "data sheets of fast valves: 1-4", 0.0, usual=2)
    ]
    closing_time: Annotated[
        float, Quantity("ms", 0, 100, "data sheets of fast valves: 1-4", 0.0, usual=1)
    ]


class Pulses(NamedTuple):
    """Parameters of `pulsed_opening`."""

    frequency: Annotated[float, Quantity("Hz", 1, 1000, "assumption: 50", usual=50)]


class TubeDelay(NamedTuple):
    """Parameters of `delayed_opening`."""

    share: Annotated[float, Quantity("1", 0, 1, "1 for a delay of all", 0.0, usual=1)]
    delay: Annotated[
        float, Quantity("ms", 0.001, 500, "length over the speed of sound: 3 for 1 m", usual=3)
    ]


def orifice_flow(upstream, downstream, conductance, critical_ratio):
    """Mass flow through an orifice, choked below a ratio of pressures.

        m' = C rho p1 psi(p2 / p1),   psi = (1 - ((r - b) / (1 - b))^2)^(1/2), 1 where r < b

    Above a ratio of 0.999 it is linear in the difference of pressures; it reverses with that.

    Args:
        upstream: absolute pressure before it (Pa).
        downstream: absolute pressure behind it (Pa).
        conductance: sonic conductance C (m^3/s/Pa).
        critical_ratio: critical pressure ratio b.
    Returns:
        Mass flow (kg/s), positive from upstream to downstream.
    Source:
        ISO 6358-1:2013, air at 20 degC.
    """
    high = maximum(upstream, downstream)
    ratio = minimum(upstream, downstream) / high
    last = (NEARLY_EQUAL - critical_ratio) / (1.0 - critical_ratio)
    subsonic = (clip(ratio, critical_ratio, NEARLY_EQUAL) - critical_ratio) / (1.0 - critical_ratio)
    slope = (1.0 - last * last) ** 0.5 / (1.0 - NEARLY_EQUAL)
    linear = slope * (upstream - downstream)
    forwards = where(upstream > downstream, high, -high)
    curved = (1.0 - subsonic * subsonic) ** 0.5 * forwards
    return DENSITY * conductance * where(ratio > NEARLY_EQUAL, linear, curved)


def valve_flow(opening, pressure, supply_pressure, p):
    """Mass flow of a valve that fills a muscle from the supply or vents it.

        m' = flow(P_supply, P) opening     where it opens to the supply, opening > 0
        m' = flow(P, P_atmosphere) opening where it vents

    Args:
        opening: share of the valve that is open, from -1 (venting) to 1 (filling).
        pressure: gauge pressure of the muscle (Pa).
        supply_pressure: gauge pressure of the tank (Pa).
        p: Valve: conductances filling and venting (m^3/s/Pa), critical_ratio.
    Returns:
        Mass flow into the muscle (kg/s).
    Source:
        ISO 6358-1:2013; the conductance is in proportion to the opening.
    """
    inside = pressure + ATMOSPHERE
    fill = orifice_flow(supply_pressure + ATMOSPHERE, inside, p.filling, p.critical_ratio)
    vent = orifice_flow(inside, ATMOSPHERE, p.venting, p.critical_ratio)
    return positive(opening) * fill - positive(-opening) * vent


def drawn_flow(opening, air_flow):
    """Mass flow that a muscle takes from the supply: what flows in while the valve is open to it.

    Args:
        opening: from -1 (venting) to 1 (filling).
        air_flow: mass flow into the muscle (kg/s).
    Returns:
        Mass flow (kg/s).
    """
    return where(opening > 0.0, 1.0, 0.0) * air_flow


def valve_kinks(opening, pressure, supply_pressure, p):
    """Signals at whose zeros the flow changes form.

    Args:
        opening: from -1 to 1.
        pressure: gauge pressure of the muscle (Pa).
        supply_pressure: gauge pressure of the tank (Pa).
        p: Valve: conductances filling and venting (m^3/s/Pa).
    Returns:
        The opening, and how far the pressure is from where filling and venting become linear (Pa);
        1 in place of each where the valve has no conductance.
    """
    fills = where(p.filling > 0.0, 1.0, 0.0)
    vents = where(p.venting > 0.0, 1.0, 0.0)
    near_supply = NEARLY_EQUAL * (supply_pressure + ATMOSPHERE) - (pressure + ATMOSPHERE)
    near_air = pressure + ATMOSPHERE - ATMOSPHERE / NEARLY_EQUAL
    return (
        fills * opening + (1.0 - fills),
        fills * near_supply + (1.0 - fills),
        vents * near_air + (1.0 - vents),
    )


def spool_opening(valve_voltage, p):
    """Opening of a proportional valve: (V - middle) / span, at most 1 either way.

    Args:
        valve_voltage: command V (V).
        p: ValveSpool: middle (V), where it is shut, span (V) from there to open.
    Returns:
        Opening, from -1 (venting) to 1 (filling).
    Source:
        Data sheets of 5/3-way proportional valves.
    """
    return clip((valve_voltage - p.middle) / p.span, -1.0, 1.0)


def loop_opening(pressure, pressure_command, p):
    """Opening that a pressure controller asks for: gain (P_command - P), at most 1 either way.

    Args:
        pressure: gauge pressure P (Pa).
        pressure_command: commanded gauge pressure (Pa).
        p: PressureLoop: gain (1/Pa).
    Returns:
        Opening, from -1 (venting) to 1 (filling).
    Source:
        A proportional controller.
    """
    return clip(p.gain * (pressure_command - pressure), -1.0, 1.0)


def mean_opening(opening, p):
    """Mean opening of an on-off valve whose pulses have the width that is asked for.

        opening' = sign(u) clip((|u| - f t_open) / (1 - f t_open - f t_close), 0, 1)

    Pulses shorter than the valve takes to open pass nothing, breaks shorter than it takes to close
    are none.

    Args:
        opening: share u of the period that is asked for, from -1 (venting) to 1 (filling).
        p: PulseWidth: frequency f (Hz), opening_time t_open, closing_time t_close (s).
    Returns:
        Opening, from -1 to 1.
    Source:
        R. B. van Varseveld and G. M. Bone 1997: dead zone and saturation of the duty cycle.
    """
    dead, full = p.frequency * p.opening_time, 1.0 - p.frequency * p.closing_time
    width = clip((abs(opening) - dead) / maximum(full - dead, 1e-3), 0.0, 1.0)
    return where(opening < 0.0, -width, width)


def mean_kinks(opening_asked, p):
    """Signals at whose zeros the mean opening begins to grow, and ends.

    Args:
        opening_asked: share of the period that is asked for, from -1 (venting) to 1 (filling).
        p: PulseWidth: frequency (Hz), opening_time, closing_time (s).
    Returns:
        How far the share is from both (1); 1 in place of each where the valve takes no time.
    """
    dead, full = p.frequency * p.opening_time, 1.0 - p.frequency * p.closing_time
    opens, closes = where(dead > 0.0, 1.0, 0.0), where(full < 1.0, 1.0, 0.0)
    width = abs(opening_asked)
    return opens * (width - dead) + (1.0 - opens), closes * (width - full) + (1.0 - closes)


def pulsed_opening(opening_asked, memory, p):
    """Opening of an on-off valve that switches at once: open where cos(phase) > cos(pi |u|).

    Args:
        opening_asked: share u of the period, from -1 (venting) to 1 (filling).
        memory: phase (rad).
        p: Pulses.
    Returns:
        -1, 0 or 1.
    Source:
        Pulse-width modulation with pulses about the middle of the period.
    """
    side = where(opening_asked < 0.0, -1.0, 1.0)
    return side * where(pulse_edge(opening_asked, memory, p) > 0.0, 1.0, 0.0)


def pulse_edge(opening_asked, memory, p):
    """How far a pulse is from its edges; the valve is open where it is positive.

    Args:
        opening_asked: share of the period, from -1 to 1.
        memory: phase (rad).
        p: Pulses.
    Returns:
        cos(phase) - cos(pi |u|) (1).
    """
    return cosine(memory) - cosine(PI * abs(opening_asked))


def phase_rate(p):
    """Rate of the phase: 2 pi frequency.

    Args:
        p: Pulses: frequency (Hz).
    Returns:
        (source, decay) with phase' = source - decay * phase (rad/s).
    """
    return 2.0 * PI * p.frequency, 0.0 * p.frequency


def delayed_opening(opening_asked, memory, p):
    """Opening that reaches the muscle after the tube's delay.

        u_out = (1 - share) u + 3/13 m_2 - 13/17 m_3 + 10/13 m_4

    Args:
        opening_asked: opening u, from -1 (venting) to 1 (filling).
        memory: the ladder m_1 to m_4.
        p: TubeDelay: share, delay (s).
    Returns:
        Opening, not beyond -1 to 1.
    Source:
        Pade approximation of order [2/4], as of every delay. The flow is that at the pressure in
        the muscle now, so that a fast valve stays stable: our simplification of E. Richer and Y.
        Hurmuzlu 2000, who delay the flow.
    """
    return clip(late(opening_asked, memory, p.share), -1.0, 1.0)


def delayed_opening_rate(opening_asked, memory, p):
    """Rates of the delay's states between valve and muscle.

    Args:
        opening_asked: opening, from -1 (venting) to 1 (filling).
        memory: the ladder.
        p: TubeDelay.
    Returns:
        For each memory (source, decay) with m' = source - decay * m (1/s).
    """
    return late_rate(opening_asked, memory, p.share, p.delay)


VALVE = Effect(
    name="valve",
    port="air_flow",
    parameters=Valve,
    law=valve_flow,
    breakpoint=valve_kinks,
    held=("critical_ratio",),
    signature="measured pressure rises in a straight line while far from the supply's (choked)",
)
VALVE_SPOOL = Effect("valve_spool", "valve_drive", ValveSpool, spool_opening)
PRESSURE_LOOP = Effect("pressure_loop", "valve_drive", PressureLoop, loop_opening)
TUBE_DELAY = Effect(
    name="tube_delay",
    port="valve_delay",
    parameters=TubeDelay,
    law=delayed_opening,
    rate=delayed_opening_rate,
    memories=4,
    held=("share",),
    signature="measured pressure answers late by the same time at every frequency",
)
PULSE_WIDTH = Effect(
    name="pulse_width",
    port="valve_shape",
    parameters=PulseWidth,
    law=mean_opening,
    breakpoint=mean_kinks,
    held=("frequency",),
    signature="no flow at small duty cycles, no more flow near the full one",
)
PULSES = Effect(
    name="pulses",
    port="valve_shape",
    parameters=Pulses,
    law=pulsed_opening,
    rate=phase_rate,
    event=pulse_edge,
    signature="measured pressure ripples at the frequency of the pulses",
)
AIR_VALVES = (VALVE, VALVE_SPOOL, PRESSURE_LOOP, TUBE_DELAY, PULSE_WIDTH, PULSES)
"""The effects of this file, in the order of the catalogue."""
