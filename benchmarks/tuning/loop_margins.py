"""The linearised loop of a row: where its gains start from, and how large its sensitivity is."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import control
import numpy as np
from scipy.optimize import root_scalar

from benchmarks.tuning.tuning_task import Job
from controllers.design.designs import Gains
from controllers.models.voltage import nominal_offset
from controllers.pid import PID, linear_law
from pma_gym.data.signals import SIGNALS
from pma_gym.engine.nominal_rig import motor_at_rest
from pma_gym.envs import StationInfo
from pma_gym.plant.forms.linear import linearize_at, operating_point
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition
from pma_gym.tasks import Actuator

"""Sensor by what is followed."""

STROKES = (0.05, 0.5, 0.95)
"""Places of the stroke at which a loop is judged, as shares of it."""


class Place(NamedTuple):
    """The plant near rest at a place of the stroke.

    Attributes:
        share: the place, as a share of the task's range.
        direction: of motion, `relaxing` (the motor pulls) or `contracting`: damping differs.
        system: in continuous time, all voltages in and outputs out.
    """

    share: float
    direction: str
    system: control.StateSpace


def linearised(station: StationInfo, shares: Iterable[float] = STROKES) -> list[Place]:
    """The nominal plant at places of the stroke, in the task's directions of motion.

    Places that no voltage holds are left out.
    """
    plant, task = Plant(station.model), station.task
    moved_by_motor = task.actuator == "motor"
    # Of the dissertation's displacement only the way out is asked for.
    both = ("relaxing", "contracting") if not task.schedule.followed.lengthens else ("relaxing",)
    places = []
    for share in shares:
        try:
            rest, commands = (_pulled if moved_by_motor else _contracted)(plant, station, share)
        except ValueError:
            continue
        for direction in both:
            places.append(Place(share, direction, linearize_at(plant, rest, commands, direction)))
    return places


def _pulled(
    plant: Plant, station: StationInfo, share: float
) -> tuple[Condition, tuple[float, float]]:
    """The plant held by the motor at a share of the stroke, at the trial's pressure."""
    schedule, parameters = station.task.schedule, station.model.parameters
    stroke = share * schedule.span
    if schedule.followed.is_angle:
        stroke *= parameters["rotor" if "rotor" in parameters else "servo"].radius
    zero = plant.settle(0.0, pressure=station.pressure).zero_contraction
    return operating_point(plant, station.pressure, zero - stroke)


def _contracted(
    plant: Plant, station: StationInfo, share: float
) -> tuple[Condition, tuple[float, float]]:
    """The plant contracted by the regulator by a share of the stroke, under the task's load.

    Raises:
        ValueError: no voltage of 0-10 V does.
    """
    motor, first = motor_at_rest(station.model, station.task), nominal_offset(station)
    at = plant.states.index("contraction")

    def contraction(voltage: float) -> float:
        return float(plant.settle(motor, regulator_voltage=voltage).state[at])

    target = contraction(first) + share * station.task.schedule.span

    def off(voltage: float) -> float:
        return contraction(voltage) - target

    voltage = float(root_scalar(off, method="brentq", bracket=(first, 10.0), xtol=1e-9).root)
    return plant.settle(motor, regulator_voltage=voltage), (motor, voltage)


def sampled(
    place: Place, station: StationInfo, actuator: Actuator | None = None
) -> control.StateSpace:
    """Measured position (m or rad) by an actuator's voltage (V) in discrete time, delays in it.

    The voltage is held over each period; the sensor's lag and the station's delays of actions and
    readings are part of the plant.

    Args:
        place: the plant there.
        station: its task, sensors, period and delays.
        actuator: whose voltage; the task's if None.
    """
    quantity = station.task.schedule.quantity
    one: Any = place.system[quantity, f"{actuator or station.task.actuator}_voltage"]
    sensor = station.model.parameters.get(SIGNALS[quantity].sensor)
    if sensor is not None:
        one = control.tf([1.0], [1.0 / (2.0 * math.pi * sensor.bandwidth), 1.0]) * one
    discrete: Any = control.ss(control.sample_system(one, station.period, method="zoh"))
    steps = round((station.action_delay + station.observation_delay) / station.period)
    if steps:
        # In a chain of states: a fraction with 1 / z^n is ill-conditioned.
        return discrete * _late(steps, station.period)
    return discrete


def _late(steps: int, period: float) -> Any:  # noqa: ANN401
    """A delay of whole periods."""
    return control.ss(np.eye(steps, k=-1), np.eye(steps)[:, :1], np.eye(steps)[-1:], 0.0, period)


class Loop:
    """The linearised loop of a job in discrete time, at several places of the stroke."""

    def __init__(self, job: Job) -> None:
        station = job.station
        self.period = station.period
        places = linearised(station)
        systems = [sampled(place, station) for place in places]
        self.shares = [place.share for place in places]
        self.plants = [tuple(map(np.asarray, (s.A, s.B, s.C))) for s in systems]
        corners = np.linspace(0.0, math.pi, 301)[1:]
        self.z = np.exp(1j * corners)
        self.responses = [self._response(*plant) for plant in self.plants]

    def _response(self, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        inverse = np.linalg.inv(self.z[:, None, None] * np.eye(len(a)) - a)
        return (c @ inverse @ b)[:, 0, 0]

    def sensitivity(self, gains: Gains) -> float:
        """Largest sensitivity |1 / (1 + C G)| over all places; infinite if one is unstable."""
        largest = 0.0
        for share, plant, response in zip(self.shares, self.plants, self.responses, strict=True):
            pa, pb, pc = plant
            a, b, c, d = linear_law(gains.scaled(share), self.period)
            closed = np.block([[pa - pb @ d @ pc, pb @ c], [-b @ pc, a]])
            if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
                return math.inf
            own = (c[0] * b[:, 0] / (self.z[:, None] - np.diag(a))).sum(axis=1) + d[0, 0]
            largest = max(largest, float(np.abs(1.0 / (1.0 + own * response)).max()))
        return largest


def lambda_tuning(job: Job) -> np.ndarray:
    """Return starting values: k_p, k_i, k_d (SI), end factor and, for the PID, lead (s)."""
    station = job.station
    (place, *_) = linearised(station, [0.5])
    one = place.system[job.schedule.quantity, f"{station.task.actuator}_voltage"]
    period, delay = station.period, station.action_delay
    gain = float(np.real(one.dcgain()))
    # Area between the step response and its end over the gain: the sum of all time constants.
    high, low = (float(np.real(one(s))) for s in (1e-4, -1e-4))
    lag = max((low - high) / 2e-4 / gain, period)
    integral = 1.0 / (gain * (2.0 * period + delay + 0.5 * period + delay))
    ahead = 0.5 * period
    if station.task.actuator == "regulator":
        # Its lag is about the muscle's. The derivative makes up for one of the two, half filtered.
        integral, ahead = 0.5 * integral, 0.25 * lag
    lead = [1.0 / (gain * integral)] if job.controller == PID.name else []
    return np.array([lag * integral, integral, ahead * lag * integral, 1.0, *lead])
