"""The local models of a station's task, and what its sensors and voltages are there."""

import math
from functools import lru_cache

import numpy as np

from controllers.models.local_model import Stroke, stroke_models
from pma_gym.data.signals import SIGNALS
from pma_gym.envs import StationInfo
from pma_gym.plant import sensors
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import structure


class ModelKey:
    """A nominal model that is equal to every other of the same laws and numbers: a key.

    Args:
        model: the model.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self._key = (*structure(model), model.vector().tobytes())
        self._hash = hash(self._key)

    def __hash__(self) -> int:
        """Of the laws and numbers."""
        return self._hash

    def __eq__(self, other: object) -> bool:
        """Whether laws and numbers are the same."""
        return isinstance(other, ModelKey) and self._key == other._key


STROKES_KEPT = 64
"""Strokes whose local models a process keeps: one a pressure, task and control period."""


def stroke_along(positions: np.ndarray, station: StationInfo) -> Stroke:
    """Local models over the stroke of a motion: the task's range, and beyond where it goes there.

    Args:
        positions: of the motion (m or rad), shape (n,).
        station: nominal model, task, pressure, control period.
    """
    task, distances = station.task, np.diff(positions)
    rises, falls = bool(np.any(distances > 0.0)), bool(np.any(distances < 0.0))
    contracts, relaxes = (rises, falls) if task.actuator == "regulator" else (falls, rises)
    directions = ("relaxing",) * relaxes + ("contracting",) * contracts
    return _stroke(
        ModelKey(station.model),
        *(task.schedule.quantity, task.actuator),
        rest_voltages(station),
        station.period,
        (min(float(positions.min()), 0.0), max(float(positions.max()), task.schedule.span)),
        directions or ("relaxing",),
    )


@lru_cache(maxsize=STROKES_KEPT)
def _stroke(
    nominal: ModelKey,
    quantity: str,
    actuator: str,
    rest: tuple[float, float],
    period: float,
    reach: tuple[float, float],
    directions: tuple[str, ...],
) -> Stroke:
    plant = Plant(nominal.model)
    return stroke_models(plant, quantity, actuator, rest, reach, directions, period)


def rest_voltages(station: StationInfo) -> tuple[float, float]:
    """Voltages of motor and regulator (V) at which the nominal station begins a trial."""
    load, drive = station.task.load, station.model.parameters.get("drive")
    motor = (load - drive.offset) / drive.gain if load and drive is not None else 0.0
    return motor, Plant(station.model).regulator_voltage(station.pressure)


def sensor_of(station: StationInfo, quantity: str) -> tuple[float, float]:
    """Lag (s) and noise (m or rad), the DAQ's rounding included, of the sensor of a quantity."""
    name = SIGNALS[quantity].sensor
    sensor = station.model.parameters.get(name)
    lag = 1.0 / (2.0 * math.pi * sensor.bandwidth) if sensor is not None else 0.0
    level = sensor.noise if sensor is not None else 0.0
    return lag, math.hypot(level, sensors.SENSORS[name].resolution / math.sqrt(12.0))
