"""The measurements that identify the station: tables I1, I2 and I3, in SI."""

from dataclasses import dataclass, fields

import numpy as np

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
