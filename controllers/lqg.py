"""Linear quadratic Gaussian control about the nominal motion, with integral action."""

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from controllers.design.designs import designed
from controllers.models.local_model import FINE, LocalModel, Stroke
from controllers.models.nominal_motion import nominal_motion
from controllers.models.operating_range import free_rotor
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.observers.deviation_filter import (
    SHARE,
    SHARE_TIME_S,
    DeviationFilter,
    Unknowns,
    with_disturbance,
)
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo

if TYPE_CHECKING:
    import control

DESIGNED_EVERY = 10
"""Every so many of the stroke's places gains are computed, and mixed between."""

FREE_MOST_V = 0.2
"""Most that feedback adds to a rotor's voltage on a loose cable (V): what is too much stays, for
nothing brakes the rotor, but a drive may have a dead zone of so much."""


FAR_SHARE = 0.03
"""Share of the range by which a rotor on a slack cable may be behind (of 90 deg: 2.7 deg)."""

TRUSTED_DOUBT = 3.0
"""Doubt of the filter beyond which k x is scaled down."""


class Settings(NamedTuple):
    """Settings of `LQG`.

    Attributes:
        effort: weight r of a volt squared, where a position's error counts as the volts that hold
            it.
        process_noise: standard deviation of the voltage that shakes the plant in a period (V).
        disturbance: of the unknown voltage's change in a second (V/s^0.5).
    """

    effort: float
    process_noise: float
    disturbance: float


BOUNDS = {"effort": (0.15, 10.0), "process_noise": (0.02, 0.3), "disturbance": (0.01, 0.2)}
"""Bounds of a search. Bolder settings than these swing from limit to limit at 50 Hz with 20 ms of
delay where a station has a third of the nominal damping, whose interval is that wide."""

DEFAULTS = {
    "displacement": Settings(0.2, 0.03, 0.05),
    "rotation": Settings(0.4, 0.05, 0.05),
    "contraction": Settings(0.2, 0.05, 0.1),
}
"""Settings by kind of task, where `designs.toml` has none."""


class LQG:
    """Regulator and Kalman filter on deviations from the nominal motion.

        v = V + V_P(P) - k(y) x - d - s H,   u = min(max(v, 0), 10 V)

    V is the voltage that the nominal plant needs (`controllers.models.nominal_motion`), V_P what
    the measured pressure adds to it, x the deviation from the plan, d and s H the voltage that the
    nominal model does not know: as estimated by `controllers.observers.deviation_filter`, and taken
    forward, over the delays of readings and commands, to when u will be in force.

    k minimises the sum of (y / g)^2 + r v^2 along the linearised plant, g its static gain: the
    solution of the discrete Riccati equation at 11 places of the stroke, mixed between them. That
    d and s H are made good is the integral action, for the filter integrates what surprises it
    into them. It receives u as held to its limits, so that nothing winds up.

    Before the first pull the rotor alone is controlled, by a model of its own and with little
    force, for nothing brakes it. On a cable that goes slack later the plan alone drives it. Where
    the readings are further off than they should be for long, the model is wrong, and k x counts
    for less.

    Args:
        settings: settings to use instead of those designed for the loop.

    Example:
        >>> from pma_gym.envs import PMAEnv
        >>> env = PMAEnv("displacement", pressure_kpa=300)
        >>> _ = env.reset(seed=1)
        >>> controller, ended = LQG(), False
        >>> controller.reset(env.reference, env.station)
        >>> while not ended:
        ...     volts = controller.act(env.measurement, env.time)
        ...     *_, broken, ended, info = env.step(env.action(volts))
        >>> broken, bool(info["rmse_mm"] < 0.05)
        (False, True)

    Source:
        K. J. Astrom and B. Wittenmark 1997, "Computer-controlled systems", chapter 11. Riccati
        equations by `scipy.linalg.solve_discrete_are`.
    """

    name = "lqg"

    def __init__(self, settings: Settings | None = None) -> None:
        self._fixed_settings = settings

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Take the nominal motion and its gains, and estimate anew."""
        settings = self._settings(station)
        self._motion = nominal_motion(reference, station)
        self._stroke, self._period = self._motion.stroke, station.period
        unknowns = Unknowns(settings.process_noise, settings.disturbance)
        self._filter = DeviationFilter(self._motion, unknowns)
        self._behind = 0.0
        self._gains = _scheduled(self._stroke, settings.effort)
        free = free_rotor(station, self._filter.order)
        if free is not None:
            a = np.eye(len(free[0]), k=1)
            a[:, 0] = free[0]
            turns = station.task.exercise is None and station.task.schedule.followed.is_angle
            lengths = 1.0 if turns else station.model.parameters["rotor"].radius
            self._free_gains = regulator(
                a, free[1], lengths / self._stroke.models[0].gain, settings.effort
            )

    def _settings(self, station: StationInfo) -> Settings:
        return self._fixed_settings or designed(self.name, station, DEFAULTS)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) to send now."""
        estimator = self._filter
        estimator.update(measurement)
        state, due = estimator.ahead()
        if estimator.alone:
            feedback = self._of_rotor(state)
        elif estimator.cable.loose:
            feedback = self._of_runaway(float(state[0]))
        else:
            feedback = self._of_muscle(state, due)
        self._behind = float(state[0])
        voltage = min(max(self._motion.voltage(due * self._period) + feedback, 0.0), VOLTAGE_LIMIT)
        estimator.send(voltage)
        return voltage

    def _of_muscle(self, state: np.ndarray, due: int) -> float:
        """Voltage (V) beside the plan's in a period, by the state estimated for it."""
        n, estimator = self._filter.order, self._filter
        unknown = float(state[n] + state[n + 1] * estimator.holding_voltage(due))
        feedback = -float(self._gains[estimator.place(due)] @ state[:n])
        # A model that is wrong makes of large gains a limit cycle.
        trust = min(1.0, TRUSTED_DOUBT / estimator.doubt)
        return estimator.correction(due) + trust * feedback - unknown

    def _of_rotor(self, state: np.ndarray) -> float:
        """As `_of_muscle`, of a rotor on a loose cable."""
        n = self._filter.order
        feedback = -float(self._free_gains @ state[:n]) - float(state[n])
        return min(max(feedback, -FREE_MOST_V), FREE_MOST_V)

    def _of_runaway(self, behind: float) -> float:
        """As `_of_muscle`, where a cable that pulled hangs loose: the plan's voltage alone.

        What noise pushes there stays. But a rotor that is far behind and falls further back coasts
        away, and nothing else stops it.
        """
        far = behind < -FAR_SHARE * self._motion.station.task.schedule.span
        return FREE_MOST_V if far and behind < self._behind else 0.0

    def linear(self, station: StationInfo, position: float) -> "control.StateSpace":
        """The feedback near a position (m or rad) once the filter has settled: volts by error.

        With s frozen and what it may change in a second counted as d's. The controller predicts
        over the delays of the station by its own last commands, which are states here.
        """
        import control

        settings = self._settings(station)
        motion = nominal_motion(station.task.schedule.at, station)
        at = motion.stroke.nearest(position)
        local, volts = motion.stroke.models[at], motion.stroke.volts[at]
        drift = np.hypot(settings.disturbance, SHARE * volts / SHARE_TIME_S**0.5)
        steady = Unknowns(settings.process_noise, float(drift))
        late = round((station.action_delay + station.observation_delay) / station.period)
        gains = regulator(local.a, local.b, 1.0 / local.gain, settings.effort)
        observer = steady_gain(local, steady, motion.noise, station.period)
        law = _law(local, np.append(gains, 1.0), observer, late)
        return control.StateSpace(*law, station.period)


@lru_cache(maxsize=128)
def _scheduled(stroke: Stroke, effort: float) -> np.ndarray:
    """Gains k at all places of a stroke, shape (places, n)."""
    at = range(0, FINE, DESIGNED_EVERY)
    models = [stroke.models[i] for i in at]
    rows = np.array([regulator(m.a, m.b, 1.0 / m.gain, effort) for m in models])
    return np.stack([np.interp(range(FINE), at, column) for column in rows.T], axis=1)


def regulator(a: np.ndarray, b: np.ndarray, weight: float, effort: float) -> np.ndarray:
    """Gains k that minimise the sum of (weight y)^2 + effort v^2 under v = -k x, y = x_1.

    Args:
        a: shape (n, n).
        b: shape (n,).
        weight: of the position (V/m or V/rad).
        effort: of the voltage.
    """
    seen = np.zeros_like(a)
    seen[0, 0] = weight**2
    cost = solve_discrete_are(a, b[:, None], seen, np.array([[effort]]))
    return b @ cost @ a / (effort + b @ cost @ b)


def steady_gain(local: LocalModel, unknowns: Unknowns, noise: float, period: float) -> np.ndarray:
    """Gain of the filter of x and d where the plant stays at one place, shape (n + 1,).

    Args:
        local: the plant there.
        unknowns: what may change.
        noise: standard deviation of a reading (m or rad).
        period: control period (s).
    """
    whole, push = with_disturbance(local)
    driven = unknowns.process_noise**2 * np.outer(push, push)
    driven[-1, -1] += unknowns.disturbance**2 * period
    spread = solve_discrete_are(whole.T, np.eye(len(push))[:, :1], driven, np.array([[noise**2]]))
    return spread[:, 0] / (spread[0, 0] + noise**2)


def _law(
    local: LocalModel, gains: np.ndarray, observer: np.ndarray, late: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C, D of the controller: voltage (V) by error (m or rad).

    Its states are x and d as predicted, and the last commands, the oldest first, that were not in
    force yet as the reading was taken.
    """
    whole, push = with_disturbance(local)
    m = len(push)
    # The estimate is z - observer (z_1 + error) of the prediction z, taken on by the commands.
    corrected, taken = np.eye(m) - np.outer(observer, np.eye(m)[0]), -observer
    power = [np.linalg.matrix_power(whole, i) for i in range(late + 1)]
    pushes = np.array([power[late - 1 - i] @ push for i in range(late)]).reshape(late, m)
    c = np.concatenate([-gains @ power[late] @ corrected, -pushes @ gains])
    d = float(-gains @ power[late] @ taken)
    a, b = np.zeros((m + late, m + late)), np.zeros(m + late)
    a[:m, :m], b[:m] = whole @ corrected, whole @ taken
    if late:
        a[:m, m] = push
        a[m:, m:] = np.eye(late, k=1)
        a[-1], b[-1] = c, d
    else:
        a[:m] += np.outer(push, c)
        b[:m] += push * d
    return a, b[:, None], c[None, :], np.array([[d]])
