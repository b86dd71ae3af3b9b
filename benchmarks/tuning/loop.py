"""The linearised loop of a row: where its gains start from, and how large its sensitivity is."""

import math
from collections.abc import Iterable
from typing import Any

import control
import numpy as np

from benchmarks.tuning.job import CONTROL_RATE_HZ, Job
from controllers.gains import Gains
from controllers.pid import PID
from pma_gym.plant.linear import linearize
from pma_gym.plant.plant import Plant

SENSORS = {"extension": "lvdt", "rotation": "potentiometer"}

STROKES = (0.05, 0.5, 0.95)
"""Places of the stroke at which the margin is judged, as shares of it."""


class Loop:
    """The linearised loop of a job in discrete time, at several places of the stroke."""

    def __init__(self, job: Job) -> None:
        self.period = 1.0 / CONTROL_RATE_HZ
        places = _linearised(job)
        self.shares = [share for share, _ in places]
        self.plants = [self._sampled(job, system) for _, system in places]
        corners = np.linspace(0.0, math.pi, 301)[1:]
        self.z = np.exp(1j * corners)
        self.responses = [self._response(*plant) for plant in self.plants]

    def _sampled(self, job: Job, system: control.StateSpace) -> tuple[np.ndarray, ...]:
        """A, B, C of plant and sensor, the voltage held over each period."""
        quantity = job.protocol.quantity
        one = system[quantity, "motor_voltage"]
        sensor = job.model.parameters.get(SENSORS[quantity])
        if sensor is not None:
            one = control.tf([1.0], [1.0 / (2.0 * math.pi * sensor.bandwidth), 1.0]) * one
        held: Any = control.ss(control.sample_system(one, self.period, method="zoh"))
        return np.asarray(held.A), np.asarray(held.B), np.asarray(held.C)

    def _response(self, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        inverse = np.linalg.inv(self.z[:, None, None] * np.eye(len(a)) - a)
        return (c @ inverse @ b)[:, 0, 0]

    def _controller(self, gains: Gains) -> tuple[np.ndarray, ...]:
        """A, B, C, D of the PID as `controllers.pid` computes it."""
        total = gains.filter + self.period
        share, slope = gains.filter / total, gains.derivative / total
        a, c = np.diag([1.0, share]), np.ones((1, 2))
        b = np.array([[gains.integral * self.period], [(share - 1.0) * slope]])
        return a, b, c, np.array([[gains.proportional + slope]])

    def sensitivity(self, gains: Gains) -> float:
        """Largest sensitivity |1 / (1 + C G)| over all places; infinite if one is unstable."""
        largest = 0.0
        for share, plant, response in zip(self.shares, self.plants, self.responses, strict=True):
            pa, pb, pc = plant
            a, b, c, d = self._controller(gains.scaled(share))
            closed = np.block([[pa - pb @ d @ pc, pb @ c], [-b @ pc, a]])
            if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
                return math.inf
            own = (c[0] * b[:, 0] / (self.z[:, None] - np.diag(a))).sum(axis=1) + d[0, 0]
            largest = max(largest, float(np.abs(1.0 / (1.0 + own * response)).max()))
        return largest


def _linearised(
    job: Job, shares: Iterable[float] = STROKES
) -> list[tuple[float, control.StateSpace]]:
    """The plant at places of the stroke (shares of it), in the task's directions of motion."""
    plant, pressure = Plant(job.model), job.pressure_kpa * 1e3
    zero = plant.settle(0.0, pressure=pressure).zero_contraction
    stroke = job.protocol.span
    directions = ["relaxing"]
    if job.protocol.quantity == "rotation":
        parameters = job.model.parameters
        stroke *= parameters["rotor" if "rotor" in parameters else "servo"].radius
        directions.append("contracting")
    systems = []
    for share in shares:
        for direction in directions:
            try:
                system = linearize(plant, pressure, zero - share * stroke, direction)
            except ValueError:
                continue  # no voltage reaches that far at this pressure
            systems.append((share, system))
    return systems


def lambda_tuning(job: Job) -> np.ndarray:
    """k_p, k_i, k_d (SI), end factor and, for the PID alone, lead (s) to start from."""
    ((_, system), *_) = _linearised(job, [0.5])
    one = system[job.protocol.quantity, "motor_voltage"]
    period = 1.0 / CONTROL_RATE_HZ
    gain = float(np.real(one.dcgain()))
    # Area between the step response and its end over the gain: the sum of all time constants.
    high, low = (float(np.real(one(s))) for s in (1e-4, -1e-4))
    lag = max((low - high) / 2e-4 / gain, period)
    integral = 1.0 / (gain * (2.0 * period + 0.5 * period))
    lead = [1.0 / (gain * integral)] if job.controller == PID.name else []
    return np.array([lag * integral, integral, 0.5 * lag * integral * period, 1.0, *lead])
