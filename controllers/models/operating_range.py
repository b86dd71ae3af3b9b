"""The local models of a station's task, and what its sensors and voltages are there.

The cable of a station: whether it pulls, and the rotor where it does not.
"""

import math
from functools import lru_cache

import numpy as np

from controllers.models.local_model import Stroke, observer_form, stroke_models
from pma_gym.data.signals import SIGNALS
from pma_gym.envs import Measurement, StationInfo
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
    return stroke_models(Plant(nominal.model), quantity, actuator, rest, reach, directions, period)


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


LOOSE_LOAD_N, LOOSE_WAY_M = 3.0, 0.25e-3
"""A cable is slack where its tension is below this, and it is wound in by so much less than its
slack: four standard deviations of the sensors each."""

SLACK_S = 35e-3
"""How long a cable must be slack to hang loose (s), and not to bounce."""

IMPACT_S = 25e-3
"""How long the rotor may swing as the cable tightens (s)."""


class Cable:
    """Whether the cable of a station pulls, by its sensors.

    Args:
        station: the nominal station; one without a cable, as a cascade, always pulls, and so does
            one whose motor holds a load.

    Attributes:
        tightened: whether it has pulled at all.
        loose: whether it hangs loose: before it first pulls, and where it has been slack a while.
        settling: whether it does, or did just now: the rotor may still swing.
    """

    def __init__(self, station: StationInfo) -> None:
        parameters = station.model.parameters
        self._exists = "cable" in parameters and station.task.actuator == "motor"
        self.loose = self.settling = self._exists
        self.tightened = not self._exists
        self._slack_from, self._slack_until = 0.0, 0.0
        self._zero: float | None = None
        if self._exists:
            self._radius = parameters["rotor"].radius
            self._least = parameters["cable"].slack - LOOSE_WAY_M

    def update(self, reading: Measurement) -> None:
        """Take a reading."""
        if not self._exists:
            return
        if self._zero is None:
            # A trial begins without load: what the cell says then is its offset.
            self._zero = reading.load
        pulls = reading.load - self._zero >= LOOSE_LOAD_N
        self.tightened = self.tightened or pulls
        way = self._radius * reading.rotation - reading.extension
        if not self.tightened or (not pulls and way < self._least):
            self._slack_until = reading.time
            self.loose = self.loose or reading.time >= self._slack_from + SLACK_S
        else:
            self._slack_from, self.loose = reading.time, False
        self.settling = reading.time < self._slack_until + IMPACT_S


def free_rotor(station: StationInfo, order: int) -> tuple[np.ndarray, np.ndarray] | None:
    """The rotor on a loose cable, sampled, in observer form; None where it never is alone.

    theta'' = (r g V - B_M theta') / J; the sensor's lag is left out.

    Args:
        station: the nominal station.
        order: order of the local models; 2 at least, else there is no room for it.
    Returns:
        Columns a_1 ... a_n and b_1 ... b_n of the local models, shape (order,) each.
    """
    parameters, period = station.model.parameters, station.period
    if station.task.actuator != "motor" or "cable" not in parameters or order < 2:
        return None
    rotor, drive = parameters["rotor"], parameters["drive"]
    rate, push = rotor.damping / rotor.inertia, rotor.radius * drive.gain / rotor.inertia
    slowed = -math.expm1(-rate * period) / rate
    a = np.array([[1.0, slowed], [0.0, 1.0 - rate * slowed]])
    b = push * np.array([(period - slowed) / rate, slowed])
    observer = observer_form((a, b, np.array([1.0, 0.0])))
    columns = np.zeros((2, order))
    columns[:, :2] = observer.reshape(2, 2) * [[-1.0], [1.0]]
    return columns[0], columns[1]
