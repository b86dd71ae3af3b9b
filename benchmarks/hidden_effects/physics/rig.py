"""The rig of the lab: numbers, static laws and sensors, all in SI."""

from collections.abc import Mapping

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
    low = rig["stiffness_low"] + rig["stiffness_low_slope"] * pressure
    high = rig["stiffness_high"] + rig["stiffness_high_slope"] * pressure
    return np.where(pressure <= SOFT_ABOVE, low, high)


def resistance(pressure: Array, velocity: Array, rig: Numbers) -> Array:
    """Damping coefficient (N s/m): one while contracting, another while relaxing."""
    fast = rig["damping_high"] + rig["damping_high_slope"] * pressure
    relaxing = np.where(pressure <= FAST_ABOVE, rig["damping_relaxing"], fast)
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
