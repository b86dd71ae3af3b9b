"""The linearised loop of a row: where its gains start from, and how large its sensitivity is."""

import math

import numpy as np

from benchmarks.tuning.job import Job
from benchmarks.tuning.plant import linearised, sampled
from controllers.design.gains import Gains
from controllers.pid import PID, linear_law


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
