"""The measurements that identify the station: tables I1, I2 and I3, in SI."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from pma_gym.data.calibration import PRESSURE_TRANSDUCER
from pma_gym.data.serres2008 import load_table
from pma_gym.units import SI_FACTORS

_MM, _KPA, _DEG = SI_FACTORS["mm"], SI_FACTORS["kPa"], SI_FACTORS["deg"]


@dataclass(frozen=True)
class StationLimits:
    """Rows of table I3, shape (rows,) each; NaN where a figure is lost.

    Attributes:
        pressure: intended pressure (Pa).
        read_pressure: the "actual" pressure as printed (Pa).
        motor_voltage: commanded (V).
        regulator_voltage: commanded (V).
        load: measured at 10 s (N).
        no_load: contraction before the load (m).
        extension: at 10 s (m).
        returned: come back by 15 s (m).
        rotation: at 10 s (rad).
        returned_rotation: come back by 15 s (rad).
    """

    pressure: np.ndarray
    read_pressure: np.ndarray
    motor_voltage: np.ndarray
    regulator_voltage: np.ndarray
    load: np.ndarray
    no_load: np.ndarray
    extension: np.ndarray
    returned: np.ndarray
    rotation: np.ndarray
    returned_rotation: np.ndarray

    def rows(self, chosen: np.ndarray) -> "StationLimits":
        """The rows of a mask."""
        return StationLimits(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @property
    def pressures(self) -> np.ndarray:
        """Distinct pressures (Pa), rising."""
        return np.unique(self.pressure)


def station_limits() -> StationLimits:
    """Table I3, misprints corrected."""
    table = load_table("I3")
    return StationLimits(
        pressure=table["pressure_nominal_kpa"] * _KPA,
        read_pressure=table["pressure_kpa"] * _KPA,
        motor_voltage=table["motor_voltage_v"],
        regulator_voltage=table["regulator_voltage_v"],
        load=table["load_n"],
        no_load=table["no_load_contraction_mm"] * _MM,
        extension=table["extension_mm"] * _MM,
        returned=table["return_mm"] * _MM,
        rotation=table["rotation_deg"] * _DEG,
        returned_rotation=table["return_rotation_deg"] * _DEG,
    )


def static_loading() -> tuple[np.ndarray, np.ndarray]:
    """Table I1: pressures (Pa) and the loads (N) held at zero contraction, shape (rows,) each."""
    table = load_table("I1")
    return table["pressure_kpa"] * _KPA, table["load_n"]


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
