"""What the DAQ logs: lagged signals plus noise, through the calibrations, quantised."""

from typing import Any

import numpy as np

from pma_gym.data import calibration
from pma_gym.data.trial import Trial
from pma_gym.plant.model import Model

SENSORS = {
    "lvdt": ("contraction", calibration.LVDT),
    "potentiometer": ("rotation", calibration.POTENTIOMETER),
    "load_cell": ("load", calibration.LOAD_CELL),
    "pressure_transducer": ("pressure", calibration.PRESSURE_TRANSDUCER),
}
"""Sensor effects by name: the output each reads, and its calibration; in the order of outputs."""


def noise_levels(model: Model) -> np.ndarray:
    """Standard deviations of the four sensors (m, rad, N, Pa); 0 for one without noise."""
    found = [model.parameters.get(name) for name in SENSORS]
    return np.array([getattr(sensor, "noise", 0.0) for sensor in found])


def read(lagged: np.ndarray, levels: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Readings of the four sensors.

    Args:
        lagged: what the sensors hold, shape (..., 4) (SI).
        levels: standard deviations, shape (4,).
        normals: standard normal numbers, shape (..., 4).
    Returns:
        Readings in SI, quantised to whole steps of the DAQ and held to its range.
    """
    noisy = lagged + levels * normals
    volts = noisy * _GAINS + _OFFSETS
    return (calibration.quantise(volts) - _OFFSETS) / _GAINS


def measure(model: Model, lagged: np.ndarray, generator: np.random.Generator | None) -> dict[str, Any]:
    """Measurements by name, of shape (rows,) each; without noise and quantisation if no generator."""
    readings = lagged
    if generator is not None:
        readings = read(lagged, noise_levels(model), generator.standard_normal(lagged.shape))
    return {name: readings[:, i] for i, (name, _) in enumerate(SENSORS.values())}


def voltages(model: Model, trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Motor and regulator voltages of a trial, from loads and pressures if it commands those.

    Raises:
        ValueError: a command is missing.
    """
    motor = _command(trial, "motor_voltage")
    if motor is None:
        drive = model.parameters.get("drive")
        load = _command(trial, "load_command")
        if load is None or drive is None:
            raise ValueError("the trial commands no motor: give motor_voltage_v or load_command_n")
        motor = (load - drive.offset) / drive.gain
    regulator = _command(trial, "regulator_voltage")
    if regulator is None:
        line, pressure = model.parameters["regulator_line"], _command(trial, "pressure_command")
        if pressure is None:
            raise ValueError(
                "the trial commands no pressure: give regulator_voltage_v or pressure_command_kpa"
            )
        regulator = (pressure - line.offset) / line.gain
    return motor, regulator


def _command(trial: Trial, name: str) -> np.ndarray | None:
    """A command, held over rows where its cell is empty; None if there is none at all."""
    values = trial.commands.get(name)
    if values is None or np.all(np.isnan(values)):
        return None
    if np.isnan(values[0]):
        raise ValueError(f"{name} has no value in the first row, so there is nothing to settle at")
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))
    return values[last]


_GAINS = np.array([line.gain for _, line in SENSORS.values()])
_OFFSETS = np.array([line.offset for _, line in SENSORS.values()])
