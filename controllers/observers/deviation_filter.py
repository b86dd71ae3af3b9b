"""Kalman filter of the deviation from the nominal motion, and of the disturbance behind it.

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

- A jump (somebody pushes): where a reading lies further off than `INNOVATION_GATE` standard
  deviations, d may have changed by `JUMP` in the period before.
- A wrong model: w also has a share `DOUBT` of what moves the plant, so that the answer to a large
  correction, or to a step of the plan, is not taken for another disturbance.
- A cable that does not pull, which the load cell and both position sensors show: d and s then
  explain nothing and stay. Before the first pull x is that of the rotor alone.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from controllers.models.local_model import LocalModel
from controllers.models.nominal_motion import NominalMotion
from controllers.models.operating_range import Cable, free_rotor, sensor_of
from controllers.models.voltage import VOLTAGE_LIMIT, nominal_offset
from controllers.observers.pressure_filter import PressureFilter
from pma_gym.envs import Measurement

ONSET_V = {"motor": 0.2, "regulator": 0.05}
"""Standard deviation of d as the motion begins (V), by actuator: 20 N, for what the muscle pulls is
unknown until the cable tightens; 3 kPa, for the trial begins settled under its load."""

SHARE = 0.1
"""Standard deviation of s at the start."""

MOST_SHARE = 0.3
"""Largest s either way."""

SHARE_TIME_S = 10.0
"""Time in which s may change by that much (s)."""

INNOVATION_GATE = 3.5
"""Standard deviations of a reading beyond which d may have jumped."""

JUMP = (0.5, 0.25)
"""By how much d may have jumped (V): 50 N. And how soon again (s): a model that is wrong is
surprised all the time."""

FREE_JUMP = (0.02, 0.05)
"""The same before the cable first tightens, for a drive may have a dead zone."""

DOUBT = 0.2
"""Share to which the model's gain and lag are known."""

DOUBT_TIME_S, MOST_INNOVATION, MOST_DOUBT = 0.3, 16.0, 4.0
"""Time of the mean of squared errors over their variances (s), the most that one counts, and the
mean beyond which a model is wrong: pushes of an operator bring it to 2."""

FREE_V = 2e-3
"""Standard deviation of what pushes a rotor on a loose cable (V); its friction is known."""

FREE_ONSET_V = 8e-3
"""Standard deviation of the drive's offset before the cable first tightens (V)."""


class Unknowns(NamedTuple):
    """What may change between two readings.

    Attributes:
        process_noise: standard deviation of the voltage w (V), white.
        disturbance: of d's change in a second (V/s^0.5).
    """

    process_noise: float
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
        doubt: how much further off readings were of late than they should be: mean of the squares
            of errors over their variances; about 1.
    """

    def __init__(self, motion: NominalMotion, unknowns: Unknowns) -> None:
        self._motion, self._station, self._period = motion, motion.station, motion.station.period
        self._stroke, self.cable = motion.stroke, Cable(motion.station)
        self.order = n = len(self._stroke.models[0].b)
        self.estimate, self._taken, self._seen = np.zeros(n + 2), 0, -1
        self._plan = _NominalTrajectory(motion)
        self._pressure, self._line = PressureFilter(self._station), None
        if self._station.task.actuator == "regulator":
            self._line = self._station.model.parameters["regulator_line"]
        # What is in force before the first command is in what the motion foresees.
        self._sent = deque(self._plan.volts[: round(self._station.action_delay / self._period)])
        self._systems = [_System.of(model.a[:, 0], model.b) for model in self._stroke.models]
        free = free_rotor(self._station, n)
        self._free = None if free is None else _System.of(*free)
        self._idle = nominal_offset(self._station)
        self._process_noise, self._noise = unknowns.process_noise**2, motion.noise**2
        self._free_noise = sensor_of(self._station, "rotation")[1] ** 2
        self._drift = np.diag([0.0] * n + [unknowns.disturbance**2, SHARE**2 / SHARE_TIME_S])
        self._drift *= self._period
        # At rest at the start: x is known exactly.
        self._covariance, onset = np.zeros((n + 2, n + 2)), ONSET_V[self._station.task.actuator]
        self._apart = onset * self._stroke.models[0].gain
        muscle, rotor = np.diag([onset**2, SHARE**2]), np.diag([FREE_ONSET_V**2, 0.0])
        self._covariance[n:, n:], other = (rotor, muscle) if self.alone else (muscle, rotor)
        self._other = np.zeros(2), other
        self._next_jump, self.doubt = -math.inf, 1.0

    @property
    def alone(self) -> bool:
        """Whether the rotor is, which has yet to tighten the cable: x is its angle's (rad)."""
        return self._free is not None and not self.cable.tightened

    def update(self, reading: Measurement) -> None:
        """Take a reading, however old: the estimate is then for when it was taken."""
        taken = round(reading.time / self._period)
        for k in range(self._taken, taken):
            before = self._pressure.pressure
            self._pressure.advance(self._commanded(self._sent[0]))
            if k + 1 == taken:
                self._pressure.update(reading.pressure)
            self._advance(0.5 * (before + self._pressure.pressure))
        # With delayed readings the first arrives several times.
        if taken > self._seen:
            if taken == 0:
                self._pressure.update(reading.pressure)
            self._seen = taken
            self._note(reading)
            self._correct(self._deviation(reading))

    def ahead(self) -> tuple[np.ndarray, int]:
        """The estimate for when the next command will be in force, and that period's number."""
        state, k = self.estimate, self._taken
        for sent in self._sent:
            state = self._moved(state, k, sent, self.correction(k))
            k += 1
        return state, k

    def send(self, voltage: float) -> None:
        """Note the command (V), as held to its limits, that `ahead` was asked for."""
        self._sent.append(voltage)

    def correction(self, k: int) -> float:
        """Voltage (V) that the pressure will call for in a period."""
        if self._line is not None:
            return -self._pressure.excess / self._line.gain
        return self._holding_voltage(
            k, self._pressure.ahead((k + 0.5 - self._taken) * self._period, self._station.pressure)
        )

    def nominal(self, k: int) -> float:
        """Voltage (V) of the nominal motion that can be in force in a period."""
        return self._plan.volts[min(k, len(self._plan.volts) - 1)]

    def holding_voltage(self, k: int) -> float:
        """Voltage H (V) that holds the nominal plant where it is planned to be in a period.

        Beside what held it at the start, where the trial began settled.
        """
        return self._stroke.volts[self.place(k)] - self._stroke.volts[self._plan.places[0]]

    def place(self, k: int) -> int:
        """Place of the stroke where the plant is planned to be in a period."""
        return self._plan.places[min(k, len(self._plan.places) - 1)]

    def _commanded(self, voltage: float) -> float:
        """Pressure (Pa) that is asked for while a voltage (V) is in force."""
        if self._line is None:
            return self._station.pressure
        return self._line.gain * voltage + self._line.offset

    def _holding_voltage(self, k: int, pressure: float) -> float:
        """Voltage (V) by which a motor has to hold against a pressure (Pa)."""
        if self.cable.loose:
            return 0.0
        return self._stroke.pressure_slopes[self.place(k)] * (pressure - self._station.pressure)

    def _system(self, k: int) -> "_System":
        """What a period does to x, d and s."""
        if self._free is not None and not self.cable.tightened:
            return self._free
        n, system = self.order, self._systems[self.place(k)]
        system.whole[:n, n + 1] = self.holding_voltage(k) * system.push[:n]
        return system

    def _moved(self, state: np.ndarray, k: int, sent: float, known: float) -> np.ndarray:
        """x, d and s after a period with a command in force, part of which is known to be lost."""
        whole, push = self._system(k)
        voltage = sent - self.nominal(k) - known
        if self.alone:
            # The drive does not push: less than where it lets go is the same.
            voltage -= min(sent + float(state[self.order]) - self._idle, 0.0)
        return whole @ state + push * voltage

    def _advance(self, pressure: float) -> None:
        """Let a control period pass, in which the pressure (Pa) was this."""
        k, sent = self._taken, self._sent.popleft()
        known = self.correction(k) if self._line is not None else self._holding_voltage(k, pressure)
        whole, push = self._system(k)
        alone = self.alone
        process_noise = (
            FREE_V**2 if alone else self._process_noise + self._misjudged(k, sent - known)
        )
        self.estimate = self._moved(self.estimate, k, sent, known)
        spread = whole @ self._covariance @ whole.T + process_noise * push[:, None] * push
        self._covariance = spread if alone else spread + self._drift
        self._taken += 1

    def _misjudged(self, k: int, voltage: float) -> float:
        """Variance of the voltage (V^2) by which the model may misjudge the motion of a period.

        Its gain and its lag are known to a share, so what pushes the plant beside the plan and what
        holds it there are, each, and what the plan moves it with.
        """
        n, state, at, nominal = self.order, self.estimate, self.place(k), self.nominal(k)
        pushed = voltage - nominal + float(state[n] + state[n + 1] * self.holding_voltage(k))
        away = float(state[0]) / self._stroke.models[at].gain
        return DOUBT**2 * (pushed**2 + away**2 + (nominal - self._stroke.volts[at]) ** 2)

    def _deviation(self, reading: Measurement) -> float:
        """By how much a reading lies from the nominal motion's (m or rad)."""
        if self.alone:
            return reading.rotation - self._motion.predicted_rotation(reading.time)
        return self._station.position(reading) - self._motion.predicted(reading.time)

    def _note(self, reading: Measurement) -> None:
        """Take in whether the cable pulls."""
        before = self.alone
        self.cable.update(reading)
        if self.alone != before:
            self._change_model()
        beyond = not 0.0 <= self._motion.voltage(reading.time - self._period) <= VOLTAGE_LIMIT
        if not self.alone and (self.cable.settling or beyond):
            # x is read off, and tells nothing of d and s.
            n, covariance = self.order, self._covariance
            covariance[:n] = covariance[:, :n] = 0.0
            covariance[range(n), range(n)] = self._apart**2

    def _change_model(self) -> None:
        """Go on with the muscle, which has a d and an s of its own."""
        n, covariance = self.order, np.zeros_like(self._covariance)
        self.estimate[:n] = 0.0
        self.estimate[n:], covariance[n:, n:] = self._other
        self._covariance = covariance

    def _correct(self, deviation: float) -> None:
        """Update the estimate by a measured deviation (m or rad)."""
        covariance, error = self._covariance, deviation - float(self.estimate[0])
        noise = self._free_noise if self.alone else self._noise
        innovation = error * error / (covariance[0, 0] + noise)
        self._wonder(innovation)
        if innovation > INNOVATION_GATE**2 and self._may_jump():
            size, apart = FREE_JUMP if self.alone else JUMP
            self._next_jump = self._taken + apart / self._period
            jump = self._system(self._taken - 1).push.copy()
            jump[self.order] = 1.0
            covariance = covariance + size**2 * jump[:, None] * jump
        gain = covariance[:, 0] / (covariance[0, 0] + noise)
        self.estimate += gain * error
        self._keep_share()
        self._covariance = covariance - gain[:, None] * covariance[0]

    def _wonder(self, innovation: float) -> None:
        """Take a squared error over its variance into the mean of late."""
        share = self._period / DOUBT_TIME_S
        self.doubt += share * (min(innovation, MOST_INNOVATION) - self.doubt)

    def _may_jump(self) -> bool:
        """Whether d may have jumped: not again at once, nor with a model that is wrong anyhow."""
        if self._taken <= self._next_jump or self.doubt > MOST_DOUBT:
            return False
        return self.alone or not self.cable.settling

    def _keep_share(self) -> None:
        """Hold s to what it may be; what is beyond is no share and d's."""
        n = self.order
        beyond = self.estimate[n + 1] - min(max(self.estimate[n + 1], -MOST_SHARE), MOST_SHARE)
        if beyond:
            self.estimate[n + 1] -= beyond
            self.estimate[n] += beyond * self.holding_voltage(self._taken)


class _NominalTrajectory:
    """The nominal motion by the number of the control period: where, and by which voltage."""

    def __init__(self, motion: NominalMotion) -> None:
        period, stroke = motion.station.period, motion.stroke
        numbers = range(len(motion.volts) + 1)
        self.places = [stroke.nearest(motion.planned(k * period)) for k in numbers]
        self.volts = [min(max(v, 0.0), VOLTAGE_LIMIT) for v in motion.volts.tolist()]


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
