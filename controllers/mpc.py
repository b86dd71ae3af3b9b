"""Preview MPC: the best voltages of the coming periods, by the nominal model kept up to date."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from controllers.design.designs import designed
from controllers.design.quadratic_program import BoundedProgram
from controllers.models.linear_motion import linear_motion
from controllers.models.nominal_motion import nominal_motion
from controllers.models.operating_range import ModelKey
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.observers.filter_bank import BankDesign, DampingBank, bank_design
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo
from pma_gym.plant.compiled_model import regulator_voltage


class Settings(NamedTuple):
    """Settings of the preview MPC.

    Attributes:
        effort: rho, weight of a change of voltage beside the error that a voltage makes (1).
        wander: by how much the force that the model does not know changes in a second (N).
        jolt: how large a force that it does not know may be for one period (N).
        horizon: how far it looks ahead (s).
    """

    effort: float
    wander: float
    jolt: float
    horizon: float = 0.15


DEFAULTS = {
    "displacement": Settings(1.0, 10.0, 1.0),
    "rotation": Settings(0.3, 5.0, 1.0),
    "contraction": Settings(0.3, 10.0, 1.0, 0.3),
}
"""Settings by kind of task where `controllers/design/designs.toml` has none."""

BOUNDS = {"effort": (1e-2, 1e2), "wander": (0.5, 100.0), "jolt": (0.1, 10.0)}
"""Within which a design searches."""

LEAST_PUSH_V = 2e-3
"""A motor voltage so little above that at which the drive begins to pull is sent as 0 V, at which
no drive pulls (V)."""

DESIGNS_KEPT = 24
"""Designs that a process keeps, some 10 MB each."""


class PreviewMPC:
    """Model predictive control along the nominal motion, with preview and a disturbance observer.

    Before a trial the nominal plant is simulated under the feed-forward's voltages u_ff and
    linearised on the way (`controllers.models.linear_motion`). In every period, from what a bank of
    Kalman filters knows of the deviations from that motion and of the forces and offsets that the
    model does not know (`controllers.observers.filter_bank`,
    `controllers.observers.filter_bank`), it foresees the error at the ends of the coming N periods,
    e = f + G v, linear in the deviations v of their voltages, and chooses

        min  |f + G v|^2 / h^2 + rho * sum over i of (v_i - v_(i-1))^2
        0 <= u_ff + v <= 10 V

    commanding the first of them. G varies along the motion (linear time-varying); h^2, the mean of
    G' G's diagonal, makes rho the same number on every station. f holds what is predicted without
    v: the error of the nominal motion, the estimated deviation, the unknown forces. With delays,
    the commands on their way are part of f, and the first voltage is that of the period in which
    it will be in force. The motor cannot push: the lower limit is where the drive, with the offset
    that it is estimated to have, begins to pull.

    If the voltages that minimise without limits keep them, they are the answer; else OSQP searches
    from the last answer on (`controllers.design.quadratic_program`). If it fails, the last plan
    goes on.

    Args:
        settings: instead of the designed ones.

    Attributes:
        settings: in use since `reset`.
        program: the quadratic program, which counts how often limits mattered (`limited`) and how
            often OSQP failed (`failures`) since `reset`.

    Source:
        J. B. Rawlings, D. Q. Mayne and M. M. Diehl 2017, "Model predictive control", chapter 1
        (without offset by models of disturbances).

    Example:
        >>> from pma_gym.envs import PMAEnv
        >>> env = PMAEnv("displacement", pressure_kpa=300)
        >>> controller = PreviewMPC()
        >>> _ = env.reset(seed=1)
        >>> controller.reset(env.reference, env.station)
        >>> ended = False
        >>> while not ended:
        ...     *_, ended, info = env.step(env.action(controller.act(env.measurement, env.time)))
        >>> bool(info["rmse_mm"] < 0.05)
        True
    """

    name = "mpc"

    def __init__(self, settings: Settings | None = None) -> None:
        self._fixed_settings = settings

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Foresee the trial: the nominal motion, the filters' gains, how voltages act.

        Raises:
            ImportError: osqp is not installed; says how to install it.
        """
        self.settings = self._fixed_settings or designed(self.name, station, DEFAULTS)
        trial = _Trial(reference, station, self.settings)
        self._design = _designed(trial)
        self._period, self._count = station.period, trial.horizon
        self._pulls = station.task.actuator == "motor"
        self._bank = DampingBank(self._design, station.period, self._pulls)
        self.program = BoundedProgram(trial.horizon)
        self._delay = trial.delay
        # What is in force until the first command arrives.
        rest = 0.0 if self._pulls else regulator_voltage(station.model, station.pressure)
        self._sent = [rest] * trial.delay
        self._plan = np.zeros(trial.horizon)
        changes = np.eye(trial.horizon) - np.eye(trial.horizon, k=-1)
        self._effort = self.settings.effort * changes.T @ changes
        self._entries = np.tril_indices(trial.horizon)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage of the task's actuator (V) to hold for the next control period."""
        self._bank.update(measurement, self._sent)
        volts = self._volts(round(time / self._period) + self._delay)
        self._sent.append(volts)
        return volts

    def _volts(self, first: int) -> float:
        """Voltage (V) for the period `first`."""
        design, motion, bank = self._design, self._design.motion, self._bank
        if first >= motion.last:
            return float(motion.volts[-1])
        estimates, weights, low = bank.at(first, self._sent), bank.weights, 0.0
        if self._pulls:
            low = max(motion.idle - float(weights @ estimates[:, design.drive]), 0.0)
        nominal = motion.volts[first : first + self._count]
        square, linear = self._problem(first, estimates, weights)
        plan = self.program.solve(square, linear, low - nominal, VOLTAGE_LIMIT - nominal)
        self._plan = np.append(self._plan[1:], self._plan[-1]) if plan is None else plan
        volts = min(max(float(nominal[0] + self._plan[0]), low), VOLTAGE_LIMIT)
        return 0.0 if self._pulls and volts < low + LEAST_PUSH_V else volts

    def _problem(
        self, first: int, estimates: np.ndarray, weights: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """H and q of the program for the periods from `first` on."""
        design, count = self._design, self._count
        predicted = (design.ahead[:, first, 1:] @ estimates[:, :, None])[:, :, 0]
        free = weights @ (predicted + design.carried[:, first, 1:])
        free += design.motion.error[first + 1 : first + 1 + count]
        response = np.tensordot(weights, design.response[:, first : first + count], 1)
        ends, begins = self._entries
        effect = np.zeros((count, count))
        effect[ends, begins] = response[begins, ends - begins + 1]
        square = effect.T @ effect
        scale = max(float(np.trace(square)) / count, 1e-30)
        linear = effect.T @ free / scale
        linear[0] -= self.settings.effort * self._plan[0]
        return square / scale + self._effort, linear


class _Trial:
    """What a design depends on, equal to every other of which it is the same."""

    def __init__(self, reference: Reference, station: StationInfo, settings: Settings) -> None:
        self.station, self.settings, task = station, settings, station.task
        self.needed = nominal_motion(reference, station).volts
        times = station.period * np.arange(len(self.needed) + 1)
        self.target = np.array([reference(time) for time in times.tolist()])
        self.horizon = max(2, round(settings.horizon / station.period))
        self.delay = round(station.action_delay / station.period)
        said = ModelKey(station.model), task.schedule.quantity, task.load, station.pressure
        follows = self.needed.tobytes(), self.target.tobytes()
        self._key = *said, station.period, self.delay, settings, *follows

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Trial) and self._key == other._key


@lru_cache(maxsize=DESIGNS_KEPT)
def _designed(trial: _Trial) -> BankDesign:
    station, settings = trial.station, trial.settings
    motion = linear_motion(trial.needed, trial.target, station, trial.horizon + trial.delay)
    return bank_design(motion, station, trial.horizon, settings.wander, settings.jolt)
