"""A muscle as a chamber of air, the tank that feeds it, and its leak."""

from typing import Annotated, NamedTuple

from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Effect
from pma_gym.effects.muscle.geometric_force import PI, STRAIGHT
from pma_gym.effects.regulator.filling import ATMOSPHERE
from pma_gym.effects.regulator.valve import HEAT, orifice_flow
from pma_gym.units import Quantity


class AirChamber(NamedTuple):
    """Parameters of `chamber_rate`."""

    exponent: Annotated[
        float,
        Quantity("1", 1, 1.67, "of a polytropic change: 1 isothermal, 1.4 adiabatic", usual=1.2),
    ]
    resting_length: Annotated[
        float, Quantity("mm", 10, 1000, "Serres 2008, 2.1.2.1: 250", usual=250)
    ]
    resting_diameter: Annotated[
        float,
        Quantity("mm", 1, 100, "of the braid: inner diameter 20 + 2 thickness = 22", usual=22),
    ]
    turns: Annotated[float, Quantity("1", 0.1, 20, "as `chou_hannaford_force`: 2.012", usual=2.012)]
    thickness: Annotated[float, Quantity("mm", 0, 10, "as `chou_hannaford_force`: 1", usual=1)]
    dead_volume: Annotated[
        float, Quantity("cm^3", 0, 1e5, "assumption: 10, end caps and hose", usual=10)
    ]
    pressure_at_start: Annotated[
        float, Quantity("kPa", 0, 2000, "of a trial with the valve shut: 200", usual=200)
    ]


class Supply(NamedTuple):
    """Parameters of `supply_pressure`."""

    pressure: Annotated[
        float, Quantity("kPa", 0, 5000, "assumption: 600, a laboratory's", usual=600)
    ]
    share: Annotated[float, Quantity("1", 0, 1, "1 for a tank that sags", 0.0, usual=1)]
    volume: Annotated[float, Quantity("l", 0.01, 1e6, "assumption: 5", usual=5)]
    refill: Annotated[float, Quantity("s", 0.01, 1e5, "assumption: 5, to 63 %", usual=5)]


class Leak(NamedTuple):
    """Parameters of `leak_flow`."""

    conductance: Annotated[
        float, Quantity("l/min/bar", 0, 1e4, "assumption: 0.05", 0.0, usual=0.05)
    ]


def muscle_volume(contraction, p):
    """Volume of air in a muscle and its hose, and its change with contraction.

        V = dead_volume + pi/4 (d - 2 t)^2 L,   d = (b^2 - L^2)^(1/2) / (pi n),   L = L0 - x

    Args:
        contraction: shortening x from the resting length (m).
        p: AirChamber: resting_length L0, resting_diameter of the braid D0, thickness t (m), turns
            n, dead_volume (m^3); b^2 = L0^2 + (pi n D0)^2.
    Returns:
        (V, dV/dx) (m^3, m^2).
    Source:
        C.-P. Chou and B. Hannaford 1996, whose force is the pressure times -dV/dL.
    """
    length = p.resting_length - contraction
    winds = PI * p.turns
    around = winds * p.resting_diameter
    thread2 = p.resting_length * p.resting_length + around * around
    square = positive((thread2 - length * length) / (winds * winds) - STRAIGHT) + STRAIGHT
    diameter = square**0.5
    inner = diameter - 2.0 * p.thickness
    growth = 2.0 * length * length / (winds * winds * diameter) - inner
    return p.dead_volume + 0.25 * PI * inner * inner * length, 0.25 * PI * inner * growth


def chamber_rate(pressure, contraction, velocity, air_flow, p):
    """Rate of the pressure in a chamber of changing volume.

        P' = exponent (R T m' - (P + P_atmosphere) V') / V

    A muscle whose valves are shut keeps (P + P_atmosphere) V^exponent.

    Args:
        pressure: gauge pressure P (Pa).
        contraction: shortening x from the resting length (m).
        velocity: rate of contraction x' (m/s).
        air_flow: mass flow into the muscle m' (kg/s).
        p: AirChamber: exponent; geometry as for `muscle_volume`.
    Returns:
        (source, decay) with P' = source - decay * P.
    Source:
        Polytropic change of an ideal gas, at the room's temperature T; textbook thermodynamics.
    """
    volume, growth = muscle_volume(contraction, p)
    change = HEAT * air_flow - (pressure + ATMOSPHERE) * growth * velocity
    return p.exponent * change / volume, 0.0 * p.exponent


def supply_pressure(memory, p):
    """Pressure of the tank: P_supply = pressure - sag.

    Args:
        memory: sag (Pa).
        p: Supply: pressure (Pa) that it is refilled to.
    Returns:
        Gauge pressure (Pa).
    Source:
        Conservation of mass.
    """
    return p.pressure - memory


def sag_rate(supply_flow, p):
    """Rate of the tank's sag: s' = share R T m' / volume - s / refill.

    Args:
        supply_flow: mass flow out of the tank m' (kg/s).
        p: Supply: share, volume (m^3), refill, the time constant of the compressor (s).
    Returns:
        (source, decay) with s' = source - decay * s.
    Source:
        Isothermal ideal gas; a pressure reducer that lets in flow in proportion to the sag.
    """
    return p.share * HEAT * supply_flow / p.volume, 1.0 / p.refill


def leak_flow(pressure, p):
    """Mass flow through a leak, out of the muscle.

    Args:
        pressure: gauge pressure (Pa).
        p: Leak: conductance (m^3/s/Pa).
    Returns:
        Mass flow into the muscle (kg/s), negative.
    Source:
        ISO 6358, as `valve_flow`, with a critical pressure ratio of 0.5.
    """
    return -orifice_flow(pressure + ATMOSPHERE, ATMOSPHERE, p.conductance, 0.5)


AIR_CHAMBER = Effect(
    name="air_chamber",
    port="regulator_lag",
    parameters=AirChamber,
    law=chamber_rate,
    replaces="regulator's lag",
    held=("resting_length", "resting_diameter", "turns", "thickness", "pressure_at_start"),
    signature="measured pressure follows the muscle's length while no valve is open",
)
SUPPLY = Effect(
    name="supply",
    port="supply",
    parameters=Supply,
    law=supply_pressure,
    rate=sag_rate,
    memory_scale=100e3,
    held=("share",),
    signature="filling becomes slower the more air was taken shortly before",
)
LEAK = Effect(
    name="leak",
    port="air_flow",
    parameters=Leak,
    law=leak_flow,
    signature="pressure falls while all valves are shut, the faster the higher it is",
)
