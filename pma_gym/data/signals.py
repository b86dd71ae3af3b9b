"""The signals: what can be commanded, measured and followed, one row each.

A rig says which of them it has. All that code asks of a signal stands here, so nothing compares
its name, and a new one is a row of this table.
"""

from dataclasses import dataclass
from typing import Literal

from pma_gym.data import calibration
from pma_gym.data.calibration import Calibration
from pma_gym.units import suffix

Kind = Literal["command", "measurement", "derived"]
Measured = Literal[
    "voltage", "displacement", "speed", "angle", "angular speed", "force", "torque", "pressure"
]

SI_UNITS: dict[str, str] = {
    "voltage": "V",
    "displacement": "m",
    "speed": "m/s",
    "angle": "rad",
    "angular speed": "rad/s",
    "force": "N",
    "torque": "N m",
    "pressure": "Pa",
}
"""Unit in SI of what signals measure."""

VOLTAGE_RANGE = (0.0, 10.0)
"""What the motor's drive and the regulator accept (V)."""

VALVE_RANGE = (-10.0, 10.0)
"""What a proportional valve accepts (V)."""


@dataclass(frozen=True)
class Signal:
    """One signal.

    Attributes:
        name: what the code calls it; in SI there.
        unit: in files (a key of `SI_FACTORS`).
        kind: "command", "measurement", or "derived" from another by a zero or a prescription.
        measures: what physical quantity it is.
        meaning: what it is, in words.
        limits: smallest and largest value in file units, where there are any.
        other_units: in which files may hold it under a column of that unit.
        sensor: effect that measures it, with its lag and noise; "" for none.
        calibration: line of its sensor's raw voltage at the DAQ; None for a sensor that has none.
        raw_column: column of files that holds that voltage instead; "" for none.
        voltage: voltage command that it stands for, by the line of a drive or regulator.
        measured: measurement that a command asks for; "" where it asks for none by name.
        reading: signal that an environment makes of it by counting from the trial's start.
        has_free_zero: its zero is the sensor's, not the rig's: differences are what counts.
        starts_at_zero: a trial counts it from its own first reading.
        shortens: it grows where the muscle shortens, so it counts against a pull.
        lengthens: it grows where the muscle is pulled out.
        called: what people call it, where that is not its name.
        least_span: smallest range in which a slope shows (SI).
        least_rate: smallest rate that counts as motion where a trial begins (SI per s).
        stems: names that files of others may give it, without unit.
        words: words in such names, in English and German.
    """

    name: str
    unit: str
    kind: Kind
    measures: Measured
    meaning: str
    limits: tuple[float, float] | None = None
    other_units: tuple[str, ...] = ()
    sensor: str = ""
    calibration: Calibration | None = None
    raw_column: str = ""
    voltage: str = ""
    measured: str = ""
    reading: str = ""
    has_free_zero: bool = False
    starts_at_zero: bool = False
    shortens: bool = False
    lengthens: bool = False
    called: str = ""
    least_span: float = 0.0
    least_rate: float = 0.0
    stems: tuple[str, ...] = ()
    words: tuple[str, ...] = ()

    @property
    def column(self) -> str:
        """Its column in files, which ends in the unit.

        >>> SIGNALS["contraction"].column
        'contraction_mm'
        """
        return f"{self.name}_{suffix(self.unit)}"

    @property
    def si_unit(self) -> str:
        """Its unit in SI.

        >>> SIGNALS["contraction"].si_unit, SIGNALS["torque_command"].si_unit
        ('m', 'N m')
        """
        return SI_UNITS[self.measures]

    @property
    def resolution(self) -> float:
        """Step in which the DAQ reads it (SI); 0 where it does not."""
        return 0.0 if self.calibration is None else self.calibration.resolution

    @property
    def is_measured(self) -> bool:
        """Whether a sensor measures it, so that files hold it."""
        return self.kind == "measurement"

    @property
    def is_angle(self) -> bool:
        """Whether it is an angle."""
        return self.measures == "angle"

    @property
    def is_travel(self) -> bool:
        """Whether it is a displacement along a line."""
        return self.measures == "displacement"

    @property
    def is_position(self) -> bool:
        """Whether it is a position, along a line or around an axis."""
        return self.measures in ("displacement", "angle")

    @property
    def is_speed(self) -> bool:
        """Whether it is the rate of a position."""
        return self.measures in ("speed", "angular speed")

    @property
    def is_force(self) -> bool:
        """Whether it is a force or a torque."""
        return self.measures in ("force", "torque")

    @property
    def is_pressure(self) -> bool:
        """Whether it is a pressure."""
        return self.measures == "pressure"


_ALL: tuple[Signal, ...] = (
    Signal(
        "motor_voltage",
        "V",
        "command",
        "voltage",
        "command to the motor's drive",
        limits=VOLTAGE_RANGE,
        stems=("motor voltage", "motor", "motor command"),
        words=("motor", "umotor", "antrieb", "drive"),
    ),
    Signal(
        "regulator_voltage",
        "V",
        "command",
        "voltage",
        "command to the pressure regulator",
        limits=VOLTAGE_RANGE,
        stems=("regulator voltage", "regulator", "valve voltage"),
        words=("regulator", "regler", "ventil", "valve", "uventil", "proportional"),
    ),
    Signal(
        "load_command",
        "N",
        "command",
        "force",
        "load asked of the drive, in place of the motor voltage",
        voltage="motor_voltage",
        measured="load",
        stems=("load command", "force command", "load setpoint"),
    ),
    Signal(
        "pressure_command",
        "kPa",
        "command",
        "pressure",
        "gauge pressure asked for, in place of the regulator voltage",
        voltage="regulator_voltage",
        measured="pressure",
        stems=("pressure command", "pressure setpoint", "set pressure"),
    ),
    Signal(
        "antagonist_voltage",
        "V",
        "command",
        "voltage",
        "command to the pressure regulator of a second muscle",
        limits=VOLTAGE_RANGE,
    ),
    Signal(
        "antagonist_pressure_command",
        "kPa",
        "command",
        "pressure",
        "gauge pressure asked for in a second muscle, in place of its voltage",
        voltage="antagonist_voltage",
        measured="antagonist_pressure",
    ),
    Signal(
        "difference_voltage",
        "V",
        "command",
        "voltage",
        "command of the difference between the pressures of two muscles",
        limits=VOLTAGE_RANGE,
    ),
    Signal(
        "pressure_difference_command",
        "kPa",
        "command",
        "pressure",
        "difference of pressures asked for, the first muscle's less the second's",
        voltage="difference_voltage",
    ),
    Signal(
        "valve_voltage",
        "V",
        "command",
        "voltage",
        "command to the valve of a muscle",
        limits=VALVE_RANGE,
    ),
    Signal(
        "antagonist_valve_voltage",
        "V",
        "command",
        "voltage",
        "command to the valve of a second muscle",
        limits=VALVE_RANGE,
    ),
    Signal(
        "torque_command",
        "N m",
        "command",
        "torque",
        "torque asked of a joint's drive",
        words=("torque", "moment", "drehmoment", "tau"),
    ),
    Signal(
        "winding_voltage",
        "V",
        "command",
        "voltage",
        "voltage at the winding of a joint's motor, of either sign",
        words=("voltage", "spannung", "volt", "motor", "umotor", "u"),
    ),
    Signal(
        "contraction_command",
        "mm",
        "command",
        "displacement",
        "motion that another drive imposes; grows as a muscle shortens",
        other_units=("m", "um", "in"),
        measured="contraction",
        stems=("contraction command", "imposed displacement", "crosshead"),
    ),
    Signal(
        "contraction",
        "mm",
        "measurement",
        "displacement",
        "shortening from the resting length, LVDT",
        sensor="lvdt",
        calibration=calibration.LVDT,
        raw_column="lvdt_v",
        reading="extension",
        has_free_zero=True,
        shortens=True,
        least_span=1e-3,
        least_rate=1.5e-3,
        stems=("contraction", "displacement", "position", "stroke"),
        words=("contraction", "weg", "position", "displacement", "stroke", "hub", "lvdt", "x"),
    ),
    Signal(
        "rotation",
        "deg",
        "measurement",
        "angle",
        "pulley angle, potentiometer; 0 at the start, grows as the motor winds in",
        sensor="potentiometer",
        calibration=calibration.POTENTIOMETER,
        raw_column="potentiometer_v",
        called="rotation of the pulley",
        has_free_zero=True,
        starts_at_zero=True,
        least_span=0.05,
        least_rate=0.1,
        stems=("rotation", "angle", "pulley angle"),
        words=("rotation", "winkel", "angle", "drehung", "encoder", "potentiometer", "phi"),
    ),
    Signal(
        "load",
        "N",
        "measurement",
        "force",
        "cable tension, load cell",
        sensor="load_cell",
        calibration=calibration.LOAD_CELL,
        raw_column="load_cell_v",
        least_span=20.0,
        least_rate=20.0,
        stems=("load", "force", "tension"),
        words=("load", "kraft", "force", "last", "tension", "f", "zugkraft"),
    ),
    Signal(
        "pressure",
        "kPa",
        "measurement",
        "pressure",
        "gauge pressure, transducer",
        sensor="pressure_transducer",
        calibration=calibration.PRESSURE_TRANSDUCER,
        raw_column="pressure_transducer_v",
        least_span=15e3,
        least_rate=15e3,
        stems=("pressure", "muscle pressure", "gauge pressure"),
        words=("pressure", "druck", "p", "press"),
    ),
    Signal(
        "antagonist_load",
        "N",
        "measurement",
        "force",
        "pull of a second muscle, load cell",
        sensor="antagonist_load_cell",
        calibration=calibration.LOAD_CELL,
        least_span=20.0,
        least_rate=20.0,
    ),
    Signal(
        "antagonist_pressure",
        "kPa",
        "measurement",
        "pressure",
        "gauge pressure of a second muscle, transducer",
        sensor="antagonist_pressure_transducer",
        calibration=calibration.PRESSURE_TRANSDUCER,
        least_span=15e3,
        least_rate=15e3,
    ),
    Signal(
        "angle",
        "deg",
        "measurement",
        "angle",
        "angle of a joint, encoder or potentiometer",
        sensor="encoder",
        other_units=("rad",),
        words=(
            "angle",
            "winkel",
            "position",
            "pos",
            "rotation",
            "drehung",
            "encoder",
            "theta",
            "phi",
        ),
    ),
    Signal(
        "speed",
        "rad/s",
        "measurement",
        "angular speed",
        "speed of a joint, gyroscope or tachometer",
        sensor="gyroscope",
        other_units=("deg/s",),
        words=("speed", "velocity", "drehzahl", "geschwindigkeit", "omega", "gyro", "tacho"),
    ),
    Signal(
        "velocity",
        "mm/s",
        "measurement",
        "speed",
        "rate of contraction, tachometer or vibrometer on a slide",
        sensor="tachometer",
        other_units=("m/s",),
        least_span=10e-3,
        least_rate=10e-3,
        stems=("velocity",),
        words=("velocity", "geschwindigkeit", "tacho"),
    ),
    Signal(
        "force",
        "N",
        "measurement",
        "force",
        "force on a drive that imposes a motion; positive pulls in the direction of contraction",
        sensor="force_sensor",
        other_units=("kN", "lbf", "kip"),
        words=("force", "kraft", "load", "last", "f"),
    ),
    Signal(
        "extension",
        "mm",
        "derived",
        "displacement",
        "how far the muscle is pulled out from where the trial began",
        sensor="lvdt",
        lengthens=True,
    ),
    Signal(
        "excess",
        "N m",
        "derived",
        "torque",
        "by how much the moment at a joint exceeds the one prescribed at its angle",
    ),
)

SIGNALS: dict[str, Signal] = {signal.name: signal for signal in _ALL}
"""All signals by name, commands first, in the order of a file's columns."""


def is_pressure(state: str) -> bool:
    """Whether a state of a rig is a pressure that it measures.

    >>> is_pressure("pressure"), is_pressure("velocity")
    (True, False)
    """
    return state in SIGNALS and SIGNALS[state].is_pressure


def signals(*names: str) -> tuple[Signal, ...]:
    """Signals by their names, in that order."""
    return tuple(SIGNALS[name] for name in names)
