"""A bank of Kalman filters, one for each damping that the station may have.

Gains and models of a bank of Kalman filters, computed before a trial.

The muscle's damping is what is known least (the identified station's 95 % interval reaches from
about none to twice the value) and what a fast loop depends on most. So the plant near its nominal
motion is taken with each of `FACTORS` on its damping. The rest of what is not known are states that
stay as they are but for noise:

    force      at the slide (N): wanders; all that the muscle's law misses, and hands that pull
    drive      of the motor (V): offset of its line; known best while the cable is loose
    regulator  (V): offset of its line, jumps
    gauge      (Pa): what the pressure transducer says too much
    gap        between the two position sensors (m at the pulley): slack and stretch of the cable

With x holding the plant's deviations and these, v the deviation of the actuator's voltage,

    x[k+1] = A[k] x[k] + b[k] v[k] + d[k],   d: what another damping does to the nominal motion

and everything is known ahead but readings: also the covariance of the estimates, so also the gains

    P-[k] = A P[k-1] A' + Q,   S = C P- C' + R,   K = P- C' / S,   P[k] = P- - K S K'

and how the position m periods ahead follows from x and from voltages (`ahead`, `response`).

Source:
    B. D. O. Anderson and J. B. Moore 1979, "Optimal filtering", sections 3.1 and 10.1.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from controllers.models.linear_motion import LOOSE_N, LinearMotion
from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant import sensors

FACTORS = (0.15, 0.5, 1.0, 2.0, 4.0)
"""Factors on the nominal damping."""

UNKNOWNS = ("force", "drive", "regulator", "gauge", "gap")

FIRST = (1.0, 0.1, 0.07, 3e3, 0.5e-3)
"""Standard deviations of the unknowns when a trial begins (N, V, V, Pa, m). Regulator: the
identified station's interval (4.3 kPa). Gauge: what the "actual" pressures of tables I2 and I3 are
off by (3.4 kPa). The others are our assumptions; the drive's 10 N covers a dead zone."""

DRIVE_WANDER, GAP_WANDER = 3e-3, 0.5e-3
"""Standard deviation of the drive's offset (V) and of the gap (m) over a second."""

LOOSE_WANDER = 0.3
"""That of the drive's offset until the nominal cable has tightened (V): a rotor that does not move
says only that the drive gives nothing yet, not by how much it falls short, so it must be searched
for. Set by hand on training stations."""

DRIVE_JOLT = 0.01
"""Standard deviation of what the drive gives beside its line for a period (V)."""

REGULATOR_WANDER = 0.2
"""Standard deviation of the regulator's offset over a second (V): 12 kPa."""


class BankDesign(NamedTuple):
    """What a bank needs: M dampings, n states, a row a period.

    Attributes:
        motion: the nominal motion.
        step: A, shape (M, steps, n, n).
        command: b, shape (M, steps, n).
        drift: d, shape (M, steps, n).
        sensors: C: extension, rotation, pressure, shape (3, n).
        gain: K, shape (M, trial + 1, n, 3).
        variance: of what the task's own sensor says against what was predicted, shape
            (M, trial + 1).
        ahead: position m = 0 ... N periods after k by x[k], shape (M, trial, N + 1, n).
        carried: what the drift adds to it, shape (M, trial, N + 1).
        response: position m periods after k by v[k], shape (M, steps, N + 1).
        drive: place of the drive's offset in x.
        own: row of the task's own sensor.
    """

    motion: LinearMotion
    step: np.ndarray
    command: np.ndarray
    drift: np.ndarray
    sensors: np.ndarray
    gain: np.ndarray
    variance: np.ndarray
    ahead: np.ndarray
    carried: np.ndarray
    response: np.ndarray
    drive: int
    own: int


def bank_design(
    motion: LinearMotion, station: StationInfo, horizon: int, wander: float, jolt: float
) -> BankDesign:
    """The design for a trial.

    Args:
        motion: the nominal motion, with at least `horizon` periods and the action delay beyond
            the trial's end.
        station: model, task, control period.
        horizon: N, how many periods are looked ahead.
        wander: standard deviation of the change of `force` over a second (N).
        jolt: standard deviation of a force at the slide that lasts a period (N).
    """
    step, command, drift, force = _sampled(motion, station)
    rotates = station.task.schedule.followed.is_angle
    radius = getattr(station.model.parameters.get("rotor"), "radius", 1.0)
    seen = np.concatenate([motion.sensors, np.zeros((3, len(UNKNOWNS)))], axis=1)
    # The sensor that the task does not ask for is off by the gap.
    seen[0 if rotates else 1, -1] = 1.0 if rotates else 1.0 / radius
    seen[2, -2] = 1.0
    own, count = (1 if rotates else 0), motion.a.shape[1]
    noise = _process_noise(motion, station, count, wander)
    pulls = DRIVE_JOLT * step[:, :, :, count + UNKNOWNS.index("drive")]
    pulls[:, :, count:] = 0.0
    jolts = np.stack([jolt * force, pulls], axis=-1)[:, : motion.last]
    gain, variance = _gains(
        *(step[:, : motion.last], jolts, noise, seen, _sensor_noise(station), own)
    )
    ahead, carried, response = _outlook(motion, step, command, drift, horizon)
    return BankDesign(
        *(motion, step, command, drift, seen, gain, variance, ahead, carried, response),
        *(count + UNKNOWNS.index("drive"), own),
    )


def _sampled(motion: LinearMotion, station: StationInfo) -> tuple[np.ndarray, ...]:
    """A, b, d, and x[k+1] by a force (N) at the slide during period k.

    One exponential of [[A, columns], [0, 0]] T holds them all.
    """
    steps, n = motion.motor.shape
    own = motion.motor if station.task.actuator == "motor" else motion.regulator
    whole, full = n + len(UNKNOWNS), n + len(UNKNOWNS) + 2
    rates = np.zeros((len(_factors(motion)), steps, full, full))
    rates[:, :, :n, :n] = motion.a
    rates[:, :, :n, n] = motion.force
    # A drive that idles gives nothing, whatever its offset: were that felt here, its uncertainty
    # would make the rotor's speed uncertain where nothing but the potentiometer tells it.
    rates[:, :, :n, n + 1] = np.where(motion.slackened[:, None], 0.0, motion.motor)
    rates[:, :, :n, n + 2] = motion.regulator
    rates[:, :, :n, whole] = own
    if motion.damped is not None:
        at, nominal = motion.damped, motion.a[:, motion.damped, motion.damped]
        for rate, factor in zip(rates, _factors(motion), strict=True):
            rate[:, at, at] *= factor
            rate[:, at, whole + 1] = (factor - 1.0) * nominal * motion.speed
    sampled = expm(rates * station.period)
    step = np.ascontiguousarray(sampled[:, :, :whole, :whole])
    parts = (sampled[:, :, :whole, at] for at in (whole, whole + 1, n))
    command, drift, force = (np.ascontiguousarray(part) for part in parts)
    force[:, :, n] = 0.0
    return step, command, drift, force


def _factors(motion: LinearMotion) -> tuple[float, ...]:
    """Factors on the damping; the nominal alone where no state is damped (cascade)."""
    return FACTORS if motion.damped is not None else (1.0,)


def _process_noise(
    motion: LinearMotion, station: StationInfo, count: int, wander: float
) -> np.ndarray:
    """Variances that every period of the trial adds to x, shape (trial, n)."""
    wanders = np.array([wander, DRIVE_WANDER, REGULATOR_WANDER, 0.0, GAP_WANDER])
    rows = np.tile(np.concatenate([np.zeros(count), wanders]), (motion.last, 1))
    if station.task.actuator == "motor":
        tightened = int(np.argmax(motion.readings[:, 2] >= LOOSE_N))
        rows[:tightened, count + UNKNOWNS.index("drive")] = LOOSE_WANDER
    return rows**2 * station.period


def _sensor_noise(station: StationInfo) -> np.ndarray:
    """Variances of LVDT, potentiometer and pressure transducer, the DAQ's rounding included."""
    levels = sensors.noise_levels(station.model)
    rounding = sensors.resolutions(station.model) / math.sqrt(12.0)
    return (levels**2 + np.square(rounding))[[0, 1, 3]]


def _gains(
    step: np.ndarray,
    jolts: np.ndarray,
    noise: np.ndarray,
    seen: np.ndarray,
    sensor: np.ndarray,
    own: int,
) -> tuple[np.ndarray, np.ndarray]:
    """K and the variance of the own sensor's innovation at the begin and after each period."""
    bank, steps, n = step.shape[:3]
    gain, variance = np.zeros((bank, steps + 1, n, len(seen))), np.zeros((bank, steps + 1))
    covariance = np.zeros((bank, n, n))
    covariance[:, range(n - len(FIRST), n), range(n - len(FIRST), n)] = np.square(FIRST)
    for k in range(steps + 1):
        if k:
            a, jolted = step[:, k - 1], jolts[:, k - 1]
            covariance = a @ covariance @ a.transpose(0, 2, 1)
            covariance += np.diag(noise[k - 1]) + jolted @ jolted.transpose(0, 2, 1)
        shared = covariance @ seen.T
        innovation = seen @ shared + np.diag(sensor)
        gain[:, k] = shared @ np.linalg.inv(innovation)
        variance[:, k] = innovation[:, own, own]
        covariance -= gain[:, k] @ shared.transpose(0, 2, 1)
        # Rounding must not make it lopsided: that grows.
        covariance = 0.5 * (covariance + covariance.transpose(0, 2, 1))
    return gain, variance


def _outlook(
    motion: LinearMotion, step: np.ndarray, command: np.ndarray, drift: np.ndarray, horizon: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`ahead`, `carried` and `response`; what comes after the trial's end counts nothing.

    Position m periods after k is that m - 1 periods after k + 1.
    """
    bank, steps, n = command.shape
    ahead = np.zeros((bank, steps + 1, horizon + 1, n))
    carried = np.zeros((bank, steps + 1, horizon + 1))
    response = np.zeros((bank, steps, horizon + 1))
    ahead[:, : motion.last + 1, 0, : len(motion.position)] = motion.position
    for m in range(1, horizon + 1):
        later = ahead[:, 1:, m - 1]
        ahead[:, :-1, m] = (later[:, :, None, :] @ step)[:, :, 0]
        response[:, :, m] = (later * command).sum(axis=-1)
        carried[:, :-1, m] = carried[:, 1:, m - 1] + (later * drift).sum(axis=-1)
    return ahead[:, : motion.last + 1].copy(), carried[:, : motion.last + 1].copy(), response


PRIOR = (0.1, 0.2, 0.4, 0.2, 0.1)
"""How likely each of `FACTORS` is before a trial: our assumption."""

MEMORY = 0.98
"""Share of what is held likely that stays from one reading to the next; the rest is `PRIOR` again,
so that a damping that changes on the way is found."""

INNOVATION_GATE = 25.0
"""Square of the innovation, in its standard deviations, beyond which a reading says no more against
a damping: what jumps surprises all."""


class DampingBank:
    """Estimates of the plant's deviations from its nominal motion, by damping.

    Every filter foresees the same reading. By how much it is wrong says how likely its damping is,

        log w <- MEMORY log w + (1 - MEMORY) log prior - (innovation^2 / S + log S) / 2

    and what is predicted is the mean over the dampings by their w.

    At a voltage under which the drive does not pull, it does not pull less: the offset that it is
    estimated to have counts only above.

    Args:
        design: what was computed before the trial.
        period: control period (s).
        pulls: whether the actuator is the motor, which cannot push.

    Attributes:
        estimates: x by damping, shape (M, n), after the last reading.
        taken: period at whose start that was.
    """

    def __init__(self, design: BankDesign, period: float, pulls: bool) -> None:
        self.design, self._period, self._pulls = design, period, pulls
        bank, _, self._states = design.command.shape
        self.estimates = np.zeros((bank, self._states))
        self.taken = -1
        self._prior = np.log(np.array(PRIOR if bank == len(FACTORS) else (1.0,)))
        self._likely = self._prior.copy()

    @property
    def weights(self) -> np.ndarray:
        """How likely each damping is, shape (M,)."""
        likely = np.exp(self._likely - self._likely.max())
        return likely / likely.sum()

    def moved(self, estimates: np.ndarray, k: int, volts: float) -> np.ndarray:
        """Estimates a period later, shape (M, n).

        Args:
            estimates: at the start of period k.
            k: the period.
            volts: in force in it (V).
        """
        design, motion = self.design, self.design.motion
        change: np.ndarray | float = volts - motion.volts[k]
        if self._pulls:
            offset = estimates[:, design.drive]
            pulling = np.maximum(volts - motion.idle + offset, 0.0)
            # x has the offset's effect already, but where the nominal drive idles.
            known = 0.0 if motion.slackened[k] else offset
            change = (pulling - known - (motion.volts[k] - motion.idle))[:, None]
        return (
            (design.step[:, k] @ estimates[:, :, None])[:, :, 0]
            + design.command[:, k] * change
            + design.drift[:, k]
        )

    def at(self, k: int, sent: list[float]) -> np.ndarray:
        """Estimates at the start of a period to come, shape (M, n).

        Args:
            k: the period.
            sent: voltages in force in the periods so far (V), at least up to that one.
        """
        estimates = self.estimates
        for period in range(max(self.taken, 0), k):
            estimates = self.moved(estimates, period, sent[period])
        return estimates

    def update(self, reading: Measurement, sent: list[float]) -> None:
        """Update the estimates with the sensors' readings; a repeated reading adds nothing.

        Args:
            reading: with the time at which it was taken.
            sent: voltages in force in the periods so far (V), at least up to that time.
        """
        k, design = round(reading.time / self._period), self.design
        if k <= self.taken:
            return
        self.estimates, self.taken = self.at(k, sent), k
        nominal = design.motion.readings[k]
        off = np.array([reading[1], reading[2], reading[4]]) - nominal[[0, 1, 3]]
        innovation = off - self.estimates @ design.sensors.T
        self.estimates = self.estimates + (design.gain[:, k] @ innovation[:, :, None])[:, :, 0]
        variance = design.variance[:, k]
        wrong = np.minimum(innovation[:, design.own] ** 2 / variance, INNOVATION_GATE)
        self._likely = MEMORY * self._likely + (1.0 - MEMORY) * self._prior
        self._likely -= 0.5 * (wrong + np.log(variance))
        self._likely -= self._likely.max()
