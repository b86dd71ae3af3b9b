"""Static curves from motor voltage to extension: the station's own, and table I3's fit."""

import numpy as np

from pma_gym.data.serres2008 import load_table
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import contraction_at, muscle_force
from pma_gym.studies.position_voltage import Quadratic

GRID_V = np.linspace(0.0, 10.0, 4001)
"""Voltages at which static curves are tabulated (V)."""

DIFFERENCE_M = 1e-5
"""Difference of contraction from which a static stiffness is taken (m)."""


class Statics:
    """A station's own static curve at one pressure, memories where its trials begin.

    Args:
        plant: the station.
        pressure: gauge pressure (Pa).

    Attributes:
        load: what the drive gives at `GRID_V` (N).
        extension: how far that pulls the muscle out (m).
    """

    def __init__(self, plant: Plant, pressure: float) -> None:
        drive = plant.model.parameters["drive"]
        self._force, self._pressure = muscle_force(plant.model), pressure
        hysteresis = plant.model.parameters.get("hysteresis")
        self._held = hysteresis.force * hysteresis.memory_at_start if hysteresis else 0.0
        self.load = np.maximum(0.0, drive.gain * GRID_V + drive.offset)
        everywhere = np.full(len(GRID_V), pressure)
        contraction = contraction_at(self._force, everywhere, self.load + self._held)
        self.rest = float(contraction[0])
        self.extension = self.rest - contraction

    def force(self, extension: np.ndarray) -> np.ndarray:
        """Load that holds the muscle at an extension (N), same shape."""
        pressure = np.full(len(extension), self._pressure)
        return self._force(pressure, self.rest - extension) - self._held

    def stiffness(self, extension: np.ndarray) -> np.ndarray:
        """Slope of the force over the extension (N/m), same shape."""
        pressure, contraction = np.full(len(extension), self._pressure), self.rest - extension
        lower, upper = contraction - DIFFERENCE_M, contraction + DIFFERENCE_M
        difference = self._force(pressure, lower) - self._force(pressure, upper)
        return difference / (2.0 * DIFFERENCE_M)

    def voltage(self, wanted: np.ndarray, expected: np.ndarray) -> np.ndarray:
        """Lowest voltage (V) at which a map gives what is wanted.

        Args:
            wanted: extension (m).
            expected: extension (m) by the map at `GRID_V`; used up to its highest.
        Returns:
            Voltage (V), 0 below the map and that of its highest beyond it.
        """
        last = int(np.argmax(expected)) + 1
        rising = np.maximum.accumulate(expected[:last])
        kept = np.concatenate([[True], np.diff(rising) > 0.0])
        return np.interp(wanted, rising[kept], GRID_V[:last][kept])


def fitted_quadratic(pressure_kpa: float) -> Quadratic:
    """Least-squares quadratic of table I3's extension on motor voltage, not rounded.

    Source:
        Serres 2008, table I3; table 18 is this, rounded.

    >>> [round(1e4 * value, 3) for value in fitted_quadratic(300)]
    [-5.134, 106.674, -49.962]
    """
    table = load_table("I3").where(pressure_nominal_kpa=pressure_kpa)
    square, linear, constant = np.polyfit(table["motor_voltage_v"], 1e-3 * table["extension_mm"], 2)
    return Quadratic(float(square), float(linear), float(constant))
