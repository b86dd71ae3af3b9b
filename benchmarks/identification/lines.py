"""The straight lines of the station: drive, regulator, pulley with its cable."""

from typing import NamedTuple

import numpy as np

from benchmarks.identification.measurements import StationLimits
from pma_gym.data.calibration import PRESSURE_TRANSDUCER

VOLTS_PER_PRINTED_KPA = 0.01
"""The "actual" pressures of I2 and I3 are transducer volts times 100, never decoded by table 1:
as printed they are 1.016 times the commanded pressure plus 3.4 kPa, decoded 0.996 times plus
0.7."""


def decoded_pressure(printed: np.ndarray) -> np.ndarray:
    """Pressure (Pa) behind "actual" pressures as printed (Pa), through table 1's calibration."""
    return PRESSURE_TRANSDUCER.from_volts(printed * 1e-3 * VOLTS_PER_PRINTED_KPA)


def drive_line(data: StationLimits) -> dict[str, float]:
    """Gain and offset of the drive: measured load on commanded voltage."""
    gain, offset = np.polyfit(data.motor_voltage, data.load, 1)
    return {"drive.gain_n_per_v": float(gain), "drive.offset_n": float(offset)}


def regulator_line(data: StationLimits) -> dict[str, float]:
    """Gain and offset of the regulator: decoded pressure on commanded voltage."""
    known = np.isfinite(data.read_pressure)
    decoded = decoded_pressure(data.read_pressure[known])
    gain, offset = np.polyfit(data.regulator_voltage[known], decoded / 1e3, 1)
    return {
        "regulator_line.gain_kpa_per_v": float(gain),
        "regulator_line.offset_kpa": float(offset),
    }


class Pulley(NamedTuple):
    """Parameters of rotation: radius (m), cable stiffness (N/m), slack (m)."""

    radius: float
    stiffness: float
    slack: float

    def rotation(self, extension: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Rotation (rad) that winds in slack, cable stretch and extension (m) under a load (N)."""
        return (extension + load / self.stiffness + self.slack) / self.radius

    def returned(self, returned: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Rotation (rad) given back: the slack stays wound in, the drive cannot unwind."""
        return (returned + load / self.stiffness) / self.radius


def fit_pulley(data: StationLimits) -> Pulley:
    """Radius, cable stiffness and slack, linear in their reciprocals, from I3's rotations.

    r theta = dL + L / k + slack     going out
    r theta = dL + L / k             coming back
    """
    out, back = np.isfinite(data.rotation), np.isfinite(data.returned_rotation)
    out &= np.isfinite(data.extension)
    back &= np.isfinite(data.returned)
    ones, zeros = np.ones(out.sum()), np.zeros(back.sum())
    columns = np.stack(
        [
            np.concatenate([data.extension[out], data.returned[back]]),
            np.concatenate([data.load[out], data.load[back]]),
            np.concatenate([ones, zeros]),
        ],
        axis=1,
    )
    angles = np.concatenate([data.rotation[out], data.returned_rotation[back]])
    per_extension, per_load, start = np.linalg.lstsq(columns, angles, rcond=None)[0]
    return Pulley(
        radius=float(1.0 / per_extension),
        stiffness=float(per_extension / per_load),
        slack=float(start / per_extension),
    )


def pulley_parameters(pulley: Pulley) -> dict[str, float]:
    """A pulley's numbers as model parameters in file units."""
    return {
        "rotor.radius_mm": pulley.radius * 1e3,
        "cable.stiffness_n_per_mm": pulley.stiffness / 1e3,
        "cable.slack_mm": pulley.slack * 1e3,
    }
