"""Ports of a station: the place, inputs, result and neutral value of the effects at each port.

The station (`pma_gym.plant.rigs.station`) computes its signals one after the other, and its
equilibrium without the cable. A law therefore has access to the signals that are known at its port.
Rates of states come last and have access to all signals. `tests/effects/test_user_effects.py`
checks this table against the station; `pma_gym.effects.rig_ports` has those of the other rigs.
"""

import math
from dataclasses import dataclass

STATES = ("contraction", "velocity", "angle", "spin", "pressure")

EVERYTHING = (
    *(*STATES, "motor_voltage", "regulator_voltage"),
    *("load_asked", "load_command", "load_arriving", "pressure_asked", "pressure_command"),
    *("stretch", "stretch_rate", "cable_tension", "muscle_force", "slide_force"),
)
"""Signals that rate laws may depend on, in addition to `memory` and `p`."""

_RANGES = {
    "contraction": 0.03,
    "position": 0.03,
    "drive_force": 5.0,
    "carried_force": 3.0,
    "velocity": 0.1,
    "angle": 1.0,
    "motor_angle": -0.5,
    "spin": 4.0,
    "pressure": 300e3,
    "pressure_asked": 310e3,
    "pressure_command": 320e3,
    "motor_voltage": 3.0,
    "regulator_voltage": 5.0,
    "regulator_time_constant": 0.1,
    "stretch": 1e-3,
    "stretch_rate": 0.05,
    "signal": 0.7,
    "opening": 0.5,
    "opening_asked": 0.4,
    "air_flow": 1e-3,
}


@dataclass(frozen=True)
class Port:
    """A place where effects act on a rig.

    Attributes:
        result: the effects' contributions at the port, and how the rig uses them.
        least: smallest number of effects.
        most: largest number of effects.
        only: names of the permitted effects; any effect of this port if empty.
        signals: signals that the law of a user's effect may depend on, in addition to `memory` and
            `p`.
        absent: neutral value of a law at the port, a number or the name of a signal; None where
            users can add no effects.
    """

    result: str
    least: int = 0
    most: float = math.inf
    only: tuple[str, ...] = ()
    signals: tuple[str, ...] = ()
    absent: float | str | None = None

    @property
    def takes(self) -> str:
        """Number or names of the permitted effects, as text."""
        if self.only:
            return " and ".join(self.only)
        if self.most == 1:
            return "exactly one effect" if self.least else "at most one effect"
        return f"{self.least} or more effects"


_MUSCLE = ("pressure", "contraction", "velocity")
_DAMPING = (*_MUSCLE, "cable_tension")
_RIPPLE = ("load_arriving", "angle", "motor_angle", "spin", "velocity", "motor_voltage")

STATION_PORTS: dict[str, Port] = {
    "muscle_force": Port(
        "force on the slide (N), added; positive shortens the muscle",
        least=1,
        signals=_MUSCLE,
        absent=0.0,
    ),
    "muscle_damping": Port(
        "damping coefficient of the slide (N s/m), added", signals=_DAMPING, absent=0.0
    ),
    "damping_factor": Port(
        "factor on the damping coefficient, multiplied", signals=_DAMPING, absent=1.0
    ),
    "slide_force": Port(
        "force on the slide (N), added; positive shortens the muscle", signals=_MUSCLE, absent=0.0
    ),
    "cable": Port("tension of the cable (N)", least=1, most=1),
    "drive": Port("load that the drive asks for (N)", least=1, most=1),
    "drive_shape": Port(
        "that load (N), changed by one effect after the other",
        signals=("load", "motor_voltage", "velocity", "spin", "pressure"),
        absent="load",
    ),
    "drive_delay": Port(
        "load command that has reached the drive (N)",
        most=1,
        signals=("load_asked", "motor_voltage"),
        absent="load_asked",
    ),
    "drive_lag": Port(
        "load that arrives at the pulley (N)",
        most=1,
        signals=("load_command", "motor_voltage"),
        absent="load_command",
    ),
    "drive_ripple": Port("load on top of what arrives (N), added", signals=_RIPPLE, absent=0.0),
    "regulator_line": Port("pressure that the regulator settles at (Pa)", least=1, most=1),
    "regulator_delay": Port(
        "pressure command that has reached the regulator (Pa)",
        most=1,
        signals=("pressure_asked", "regulator_voltage"),
        absent="pressure_asked",
    ),
    "regulator_lag": Port("rate of the pressure (Pa/s)", least=1, most=1),
    "regulator_pace": Port(
        "factor on the regulator's rate, multiplied",
        signals=("pressure", "pressure_command", "regulator_time_constant"),
        absent=1.0,
    ),
    "chamber": Port(
        "rate of the pressure beside the regulator's (Pa/s), added", signals=_MUSCLE, absent=0.0
    ),
}
"""Ports of a station: for each the number of effects, the use of their results, and its signals."""

SENSOR, SENSOR_DELAY, MOUNT = "sensor:", "sensor_delay:", "mount:"
"""Prefixes, before an output's name, of the ports of a sensor's errors and lag, of its delay, and
of what lies between the output and its sensor, whose model may lack a lag."""


def example(signal: str) -> float:
    """Typical value (SI) of a signal."""
    return _RANGES.get(signal, 200.0)


def measured_output(port: str) -> str:
    """Output of a rig that a sensor's port belongs to; "" for another port.

    >>> measured_output("sensor_delay:angle"), measured_output("drive_delay")
    ('angle', '')
    """
    prefixes = (each for each in (SENSOR, SENSOR_DELAY, MOUNT) if port.startswith(each))
    return port.removeprefix(next(prefixes, port))
