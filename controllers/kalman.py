"""A Kalman filter of how far the plant is from its nominal motion, and of what pushes it there.

In deviations from the nominal motion the plant is, near a place of the stroke,

    x[k+1] = a x[k] + b (v[k] + d[k] + s[k] H[k] + w),   y[k] = c x[k] + noise
    d[k+1] = d[k] + w_d,   s[k+1] = s[k] + w_s

y the position's deviation, v the voltage in force beside the nominal motion's V. Of what the
nominal model does not know, d is a voltage and s a share of H, the voltage that holds the position:
a muscle that pulls 10 % harder needs 10 % more all along the way, which a filter that knows H need
not learn anew at every place. Their estimates are the integral action: a controller that subtracts
both leaves no steady error. What the measured pressure explains is known and left out.

The model changes along the way, so the covariance is computed as it goes. Three things are no
Gaussian noise:

- A jump (somebody pushes): where a reading lies further off than `SURPRISE` standard deviations,
  d may have changed by `JUMP` in the period before.
- A wrong model: w also has a share `DOUBT` of what moves the plant, so that the answer to a large
  correction, or to a step of the plan, is not taken for another disturbance.
- A cable that does not pull, which the load cell and both position sensors show: d and s then
  explain nothing and stay. Before the first pull x is the rotor's alone.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from controllers.cable import Cable, free_rotor
from controllers.local_model import VOLTAGE_LIMIT, LocalModel
from controllers.motion import NominalMotion
from controllers.pressure import PressureFilter
from controllers.stroke import sensor_of
from pma_gym.envs import Reading

ONSET_V = {"motor": 0.2, "regulator": 0.05}
"""Standard deviation of d as the motion begins (V), by actuator: 20 N, for what the muscle pulls is
unknown until the cable tightens; 3 kPa, for the trial begins settled under its load."""

SHARE = 0.1
"""Standard deviation of s at the start."""

MOST_SHARE = 0.3
"""Largest s either way."""

SHARE_TIME_S = 10.0
"""Time in which s may change by that much (s)."""

SURPRISE = 3.5
"""Standard deviations of a reading beyond which d may have jumped."""

JUMP = (0.5, 0.25)
"""By how much d may have jumped (V): 50 N. And how soon again (s): a model that is wrong is
surprised all the time."""

FREE_JUMP = (0.02, 0.05)
"""The same before the cable first tightens, for a drive may have a dead zone."""

DOUBT = 0.2
"""Share to which the model's gain and lag are known."""

FREE_V = 2e-3
"""Standard deviation of what pushes a rotor on a loose cable (V); its friction is known."""

FREE_ONSET_V = 8e-3
"""Standard deviation of the drive's offset before the cable first tightens (V)."""


class Unknowns(NamedTuple):
    """What may change between two readings.

    Attributes:
        agitation: standard deviation of the voltage w (V), white.
        disturbance: of d's change in a second (V/s^0.5).
    """

    agitation: float
    disturbance: float


class DeviationFilter:
    """The filter, one control period after the other.

    Args:
        motion: the nominal motion.
        unknowns: what may change.

    Attributes:
        estimate: x, d and s at the beginning of the period of the last reading, shape (n + 2,).
        order: n.
        cable: whether it pulls.
    """

    def __init__(self, motion: NominalMotion, unknowns: Unknowns) -> None:
        self._motion, self._station, self._period = motion, motion.station, motion.station.period
        self._stroke, self.cable = motion.stroke, Cable(motion.station)
        self._first = self._at(0.0)
        self.order = n = len(self._stroke.models[0].b)
        self.estimate, self._taken, self._seen = np.zeros(n + 2), 0, -1
        self._pressure = PressureFilter(self._station)
        # What is in force before the first command is in what the motion foresees.
        late = round(self._station.action_delay / self._period)
        self._sent = deque(self.nominal(k * self._period) for k in range(late))
        moves_pressure = self._station.task.actuator == "regulator"
        line = self._station.model.parameters["regulator_line"]
        self._line = line if moves_pressure else None
        self._systems = [_System.of(model.a[:, 0], model.b) for model in self._stroke.models]
        free = free_rotor(self._station, n)
        self._free = None if free is None else _System.of(*free)
        self._agitation, self._noise = unknowns.agitation**2, motion.noise**2
        self._free_noise = sensor_of(self._station, "rotation")[1] ** 2
        self._drift = np.diag([0.0] * n + [unknowns.disturbance**2, SHARE**2 / SHARE_TIME_S])
        self._drift *= self._period
        # At rest at the start: x is known exactly.
        self._covariance = np.zeros((n + 2, n + 2))
        self._covariance[n + 1, n + 1] = SHARE**2
        self._onset = ONSET_V[self._station.task.actuator]
        self._covariance[n, n] = (FREE_ONSET_V if self.cable.loose else self._onset) ** 2
        self._next_jump = -math.inf
        self.surprise = 1.0

    @property
    def alone(self) -> bool:
        """Whether x is that of the rotor, which has yet to tighten the cable (rad)."""
        return self._free is not None and not self.cable.tightened

    def see(self, reading: Reading) -> None:
        """Take a reading, however old: the estimate is then for when it was taken."""
        taken = round(reading.time / self._period)
        for k in range(self._taken, taken):
            before = self._pressure.pressure
            self._pressure.advance(self._commanded(self._sent[0]))
            if k + 1 == taken:
                self._pressure.see(reading.pressure)
            self._advance(0.5 * (before + self._pressure.pressure))
        # With readings that are late the first is heard several times.
        if taken > self._seen:
            if taken == 0:
                self._pressure.see(reading.pressure)
            self._seen = taken
            self._note(reading)
            self._correct(self._deviation(reading))

    def ahead(self) -> tuple[np.ndarray, float]:
        """The estimate for when the next command will be in force, and that time (s)."""
        state, k = self.estimate, self._taken
        for sent in self._sent:
            whole, push = self._system(k)
            time = k * self._period
            state = whole @ state + push * (sent - self.nominal(time) - self.correction(time))
            k += 1
        return state, k * self._period

    def correction(self, time: float) -> float:
        """Voltage (V) that the pressure will call for in the period that begins at a time (s)."""
        if self._line is not None:
            return -self._pressure.excess / self._line.gain
        ahead = time + (0.5 - self._taken) * self._period
        return self._held(time, self._pressure.ahead(ahead, self._station.pressure))

    def send(self, voltage: float) -> None:
        """Note the command (V), as held to its limits, that `ahead` was asked for."""
        self._sent.append(voltage)

    def nominal(self, time: float) -> float:
        """Voltage (V) of the nominal motion that can be in force at a time (s)."""
        return min(max(self._motion.voltage(time), 0.0), VOLTAGE_LIMIT)

    def held(self, time: float) -> float:
        """Voltage H (V) that holds the nominal plant where it is planned to be at a time (s).

        Beside what held it at the start, where the trial began settled.
        """
        return self._stroke.volts[self._at(time)] - self._stroke.volts[self._first]

    def _at(self, time: float) -> int:
        return self._stroke.nearest(self._motion.planned(time))

    def _commanded(self, voltage: float) -> float:
        """Pressure (Pa) that is asked for while a voltage (V) is in force."""
        if self._line is None:
            return self._station.pressure
        return self._line.gain * voltage + self._line.offset

    def _held(self, time: float, pressure: float) -> float:
        """Voltage (V) by which a motor has to hold against a pressure (Pa)."""
        if self.cable.loose:
            return 0.0
        return self._motion.pressure_correction(self._motion.planned(time), pressure)

    def _system(self, k: int) -> "_System":
        """What a period does to x, d and s."""
        if self._free is not None and not self.cable.tightened:
            return self._free
        n, time = self.order, k * self._period
        system = self._systems[self._at(time)]
        system.whole[:n, n + 1] = self.held(time) * system.push[:n]
        return system

    def _deviation(self, reading: Reading) -> float:
        """By how much a reading lies from the nominal motion's (m or rad)."""
        if self.alone:
            return reading.rotation - self._motion.foreseen_rotation(reading.time)
        return self._station.position(reading) - self._motion.foreseen(reading.time)

    def _advance(self, pressure: float) -> None:
        """Let a control period pass, in which the pressure (Pa) was this."""
        whole, push = self._system(self._taken)
        time = self._taken * self._period
        known = self.correction(time) if self._line is not None else self._held(time, pressure)
        voltage = self._sent.popleft() - self.nominal(time) - known
        agitation = FREE_V**2 if self.alone else self._agitation + self._doubt(voltage)
        self.estimate = whole @ self.estimate + push * voltage
        spread = whole @ self._covariance @ whole.T + agitation * push[:, None] * push
        self._covariance = spread if self.alone else spread + self._drift
        self._taken += 1

    def _doubt(self, voltage: float) -> float:
        """Variance of the voltage (V^2) by which the model may misjudge the motion.

        Its gain and its lag are known to a share, so what pushes the plant beside the plan and what
        holds it there are, each, and what the plan moves it with.
        """
        n, state, time = self.order, self.estimate, self._taken * self._period
        pushed = voltage + float(state[n] + state[n + 1] * self.held(time))
        at = self._at(time)
        gain, planned = self._stroke.models[at].gain, self.nominal(time) - self._stroke.volts[at]
        return DOUBT**2 * (pushed**2 + (float(state[0]) / gain) ** 2 + planned**2)

    def _note(self, reading: Reading) -> None:
        """Take in whether the cable pulls."""
        n, before = self.order, self.cable.tightened
        self.cable.see(reading)
        if self.cable.tightened != before:
            self._covariance[n, n] += self._onset**2
            self.estimate[:n] = 0.0
        if not self.alone and (self.cable.settling or self._beyond(self._taken - 1)):
            # x is read off, and tells nothing of d and s.
            covariance = self._covariance
            covariance[:n] = covariance[:, :n] = 0.0
            covariance[range(n), range(n)] = (self._onset * self._stroke.models[0].gain) ** 2

    def _keep_share(self) -> None:
        """Hold s to what it may be; what is beyond is no share and d's."""
        n, most = self.order, MOST_SHARE
        beyond = self.estimate[n + 1] - min(max(self.estimate[n + 1], -most), most)
        if beyond:
            self.estimate[n + 1] -= beyond
            self.estimate[n] += beyond * self.held(self._taken * self._period)

    def _beyond(self, k: int) -> bool:
        """Whether the nominal plant itself needs what no voltage gives in a period."""
        return not 0.0 <= self._motion.voltage(k * self._period) <= VOLTAGE_LIMIT

    def _correct(self, deviation: float) -> None:
        """Update the estimate by a measured deviation (m or rad)."""
        covariance, error = self._covariance, deviation - float(self.estimate[0])
        noise = self._free_noise if self.alone else self._noise
        spread = covariance[0, 0] + noise
        surprise = error * error / spread
        self.surprise += self._period / 0.3 * (min(surprise, 16.0) - self.surprise)
        surprising = surprise > SURPRISE**2 and self._taken > self._next_jump and self.surprise < 4
        if surprising and (self.alone or not self.cable.settling):
            size, apart = FREE_JUMP if self.alone else JUMP
            self._next_jump = self._taken + apart / self._period
            jump = self._system(self._taken - 1).push.copy()
            jump[self.order] = 1.0
            covariance = covariance + size**2 * jump[:, None] * jump
            spread = covariance[0, 0] + noise
        gain = covariance[:, 0] / spread
        self.estimate += gain * error
        self._keep_share()
        self._covariance = covariance - gain[:, None] * covariance[0]


def with_disturbance(local: LocalModel) -> tuple[np.ndarray, np.ndarray]:
    """What a period does to x and d: by themselves, and per volt."""
    n = len(local.b)
    system = _System.of(local.a[:, 0], local.b)
    return system.whole[: n + 1, : n + 1], system.push[: n + 1]


class _System(NamedTuple):
    """What a period does to x, d and s.

    Attributes:
        whole: by themselves, shape (n + 2, n + 2); the column of s, which depends on H, is left
            for whoever uses it.
        push: per volt, shape (n + 2,).
    """

    whole: np.ndarray
    push: np.ndarray

    @classmethod
    def of(cls, column: np.ndarray, b: np.ndarray) -> "_System":
        """From a_1 ... a_n as they stand in the first column, and b_1 ... b_n."""
        n = len(b)
        whole = np.eye(n + 2)
        whole[:n, :n] = np.eye(n, k=1)
        whole[:n, 0], whole[:n, n] = column, b
        return cls(whole, np.append(b, [0.0, 0.0]))
