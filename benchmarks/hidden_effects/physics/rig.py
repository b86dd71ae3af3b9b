"""The rig of the lab: numbers, static laws, sensors, all in SI; how hidden effects act on it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = Mapping[str, Array]
"""Parameters by name, one number a lane."""

NOMINAL: dict[str, float] = {
    "force_slope": 2.91e-3,
    "force_intercept": 44.6,
    "stiffness_low": 32.7e3,
    "stiffness_low_slope": -0.0321,
    "stiffness_high": 17.0e3,
    "stiffness_high_slope": 0.0179,
    "damping_contracting": 2900.0,
    "damping_relaxing": 1570.0,
    "damping_high": 311.0,
    "damping_high_slope": 0.00338,
    "drive_gain": 97.84,
    "drive_offset": -2.0,
    "radius": 25.4e-3,
    "inertia": 2.0e-3,
    "mass": 0.5,
    "cable_stiffness": 550e3,
    "cable_damping": 19.4,
    "regulator_gain": 59.9e3,
    "regulator_offset": -20.4e3,
    "regulator_time": 0.10,
}
"""What the lab believes (SI)."""

SOFT_ABOVE, FAST_ABOVE = 314e3, 372e3
"""Pressures (Pa) at which stiffness and relaxing damping change over to their second line."""

ROTOR_DAMPING = 7.64e-4
"""Viscous damping of the rotor (N m s)."""

SIGNALS = ("contraction", "rotation", "load", "pressure")
SENSORS = ("lvdt", "potentiometer", "load_cell", "pressure_transducer")
"""The sensor of each signal."""

BANDWIDTH = (100.0, 200.0, 500.0, 50.0)
"""First-order bandwidths of the sensors (Hz)."""

UNITS = (1e-3, np.pi / 180.0, 1.0, 1e3)
"""SI value of the unit in which each signal is written: mm, deg, N, kPa."""

NOISE = (0.02, 0.1, 0.5, 0.3)
"""Standard deviations of the sensors' noise, in these units."""

VOLTS = ((0.0979, -0.881), (0.0142, 0.087), (0.0041, 0.0347), (0.0102, 0.027))
"""Gain (V a unit) and offset (V) of the sensors' calibrations."""

DAQ_STEP = 20.0 / 4096
"""Step of the 12-bit converter, -10 to 10 V (V)."""


def stiffness(pressure: Array, rig: Numbers) -> Array:
    """Stiffness of the muscle (N/m) at gauge pressures (Pa)."""
    return np.where(
        pressure <= SOFT_ABOVE,
        rig["stiffness_low"] + rig["stiffness_low_slope"] * pressure,
        rig["stiffness_high"] + rig["stiffness_high_slope"] * pressure,
    )


def resistance(pressure: Array, velocity: Array, rig: Numbers) -> Array:
    """Damping coefficient (N s/m): one while contracting, another while relaxing."""
    relaxing = np.where(
        pressure <= FAST_ABOVE,
        rig["damping_relaxing"],
        rig["damping_high"] + rig["damping_high_slope"] * pressure,
    )
    return np.where(velocity > 0.0, rig["damping_contracting"], relaxing)


def tension(stretch: Array, rate: Array, rig: Numbers) -> Array:
    """Tension (N) of a cable stretched by (m) at a rate (m/s); its damper comes in over 40 N."""
    spring = rig["cable_stiffness"] * np.maximum(stretch, 0.0)
    share = np.minimum(spring / 40.0, 1.0)
    damper = share * share * (3.0 - 2.0 * share) * rig["cable_damping"] * rate
    return np.maximum(spring + damper, 0.0)


def daq_steps(signal: int) -> float:
    """What one step of the converter stands for, in the unit of a signal's file."""
    return DAQ_STEP / VOLTS[signal][0]


def noise_levels(factors: Array) -> Array:
    """Noise and rounding together (SI), shape (4,), for factors on the nominal noise."""
    steps = np.array([daq_steps(i) for i in range(4)])
    return np.sqrt((np.array(NOISE) * factors) ** 2 + steps**2 / 12.0) * np.array(UNITS)


@dataclass
class Moment:
    """The rig in the middle of a step, one number a lane (SI).

    Attributes:
        step: size of the step (s).
        rig: true parameters.
        resting: contraction with no load at the first pressure.
        order: how many trials were made before this one.
        contraction: of the muscle.
        velocity: its rate at the beginning of the step.
        angle: of the pulley.
        spin: its rate at the beginning of the step.
        pressure: in the muscle.
        asked: pressure asked for.
        tension: of the cable, one step ago.
        load: that the drive gives.
    """

    step: float
    rig: Numbers
    resting: Array
    order: Array
    contraction: Array
    velocity: Array
    angle: Array
    spin: Array
    pressure: Array
    asked: Array
    tension: Array
    load: Array


class Hidden:
    """An effect at work in all lanes at once; where its size is 0 it changes nothing.

    Attributes:
        static: whether `force` has no memory and holds at rest too.
    """

    static = False

    def begin(self, moment: Moment) -> None:
        """Set memories for a rig at rest."""

    def motor_delay(self) -> Array | float:
        """Time (s) by which the motor's command is late."""
        return 0.0

    def regulator_delay(self) -> Array | float:
        """Time (s) by which the regulator's command is late."""
        return 0.0

    def loads(self, loads: Array, step: float) -> Array:
        """Loads (N) of a drive that asks for these, shape (steps, lanes)."""
        return loads

    def pressures(self, asked: Array, step: float) -> Array:
        """Pressures (Pa) asked for of the valve, shape (steps, lanes)."""
        return asked

    def flow(self, rate: Array, moment: Moment) -> Array:
        """Rate of the pressure (Pa/s) that the regulator brings about."""
        return rate

    def chamber(self, moment: Moment) -> Array | float:
        """Rate of the pressure (Pa/s) beside that."""
        return 0.0

    def damping(self, moment: Moment) -> Array | float:
        """Factor on the damping."""
        return 1.0

    def force(self, moment: Moment) -> Array | float:
        """Force (N) on the slide, positive where it shortens the muscle."""
        return 0.0

    def pull(self, moment: Moment) -> Array | float:
        """Load (N) at the pulley beside the drive's."""
        return 0.0

    def slack(self) -> Array | float:
        """Cable (m) to wind in before it pulls."""
        return 0.0

    def bandwidths(self, bandwidths: Array) -> Array:
        """Bandwidths (Hz) of the sensors, shape (4, lanes)."""
        return bandwidths

    def sensed(self, signals: list[Array], step: float) -> list[Array]:
        """What the sensors stand on, four of shape (steps, lanes) (SI)."""
        return signals

    def shown(self, readings: Array) -> Array:
        """Readings as a sensor shows them, noise and all, shape (lanes, rows, 4) (SI)."""
        return readings
