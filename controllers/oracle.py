"""Predictive controller that knows the true station and its state: a bound for the others.

What it knows that no controller of a real station does: the station's own equations and numbers,
its state, the memories of hysteresis and friction, the commands on their way to it, and the
disturbances that act now. It does not know disturbances to come; it takes those of now to stay.

In every period it plans the voltages of the coming 0.32 s, each in 0-10 V, changed by blocks of 1,
1, 2, 4, 8, ... periods until they make

    sum over times t of (position(t) - reference(t))^2

least, and commands the first of them. At first the times are as dense as those of the scores, then
10 ms apart and weighted for it (`controllers.oracle`); none lies after the trial's end.
Changes of the plan of the period before are searched for by least squares
(`controllers.design.bounded_least_squares`) with the true plant's own simulation
(`controllers.oracle`). A plan's last period is new each time; there it goes on as the
voltages do that the true station's inverse needs for the reference
(`controllers.models.nominal_motion`). Those voltages themselves are tried too, and pushes of a
period where the cable hangs loose: it gives no slope to follow.

It is close to the optimum, not proven to be it.

Predict a plant under several voltage sequences at once, from its present state.

Prediction horizon: its length, and the times at which errors count.
"""

import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from controllers.design.bounded_least_squares import Errors, Space, best_plan
from controllers.models.nominal_motion import nominal_motion
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo
from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    from pma_gym.envs import PMAEnv
from typing import NamedTuple

from pma_gym.integrator.trial_kernel import JOB
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition

HORIZON_S, LONGEST = 0.32, 64
"""How far it looks ahead at least (s), and after how many periods that is enough anyway."""

DENSE = 4
"""Periods whose errors count at every scored sample."""

SPARSE_S = 0.01
"""Time between the errors that count after them (s), or a period if that is longer."""


class Horizon(NamedTuple):
    """The prediction horizon, by rows of a prediction.

    Attributes:
        parts: scored samples a period.
        blocks: which of the plan's voltages is in force in every period, shape (periods,).
        periods: period of every row, those of commands on their way counted before, shape (rows,).
        ends: when rows end, from where the plan is in force (periods / parts), shape (rows,).
        weights: root of how many samples a row's end stands for; 0 before the plan, shape (rows,).
    """

    parts: int
    blocks: NDArray[np.int64]
    periods: NDArray[np.int64]
    ends: NDArray[np.int64]
    weights: NDArray[np.float64]


def horizon(period: float, delay: int) -> Horizon:
    """The horizon of a control period (s) and an action delay (periods)."""
    parts = max(1, round(period * SAMPLE_RATE_HZ))
    lengths = block_lengths(period)
    coarse = max(1, min(parts, round(period / SPARSE_S)))
    counts = np.full(delay + sum(lengths), coarse)
    counts[:delay], counts[delay : delay + DENSE] = 1, parts
    periods = np.repeat(np.arange(len(counts)), counts)
    own = np.arange(len(periods)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
    ends = (periods - delay) * parts + np.round(own * parts / counts[periods]).astype(int)
    weights = np.where(periods < delay, 0.0, np.sqrt(np.diff(ends, prepend=-delay * parts)))
    return Horizon(parts, np.repeat(np.arange(len(lengths)), lengths), periods, ends, weights)


def block_lengths(period: float) -> list[int]:
    """For how many periods each voltage of a plan is held.

    >>> block_lengths(0.01)
    [1, 1, 2, 4, 8, 16]
    """
    lengths = [1, 1]
    while sum(lengths) * period < HORIZON_S - 1e-9 and sum(lengths) < LONGEST:
        lengths.append(2 * lengths[-1])
    return lengths


PLANS = 16
"""How many plans are tried at once: a whole number of registers of any processor."""


class Commands(NamedTuple):
    """Voltages (V) of both actuators: a number each, or an array of shape (plans, rows)."""

    motor: float | NDArray[np.float64]
    regulator: float | NDArray[np.float64]


class Prediction:
    """Simulates up to 16 voltage sequences from one state, and reuses the memory of earlier ones.

    The same compiled plant as `Plant.step`, with its arrays made once: of a prediction's 30 us,
    making them anew would be 200.

    Args:
        plant: the plant.
        times: when rows begin, from now, and the last one's end (s), shape (rows + 1,).
    """

    def __init__(self, plant: Plant, times: NDArray[np.float64]) -> None:
        self.plant, self.rows = plant, len(times) - 1
        rows, count = self.rows, len(plant.states)
        self._time = np.ascontiguousarray(times, float)
        self._motor, self._regulator = np.zeros((2, PLANS, rows + 1))
        self._start = np.zeros((PLANS, count + 2))
        self._states = np.zeros((PLANS, rows + 1, count))
        self._outputs = np.zeros((PLANS, rows + 1, len(plant.outputs)))
        self._taken, self._attempts = np.zeros(8, np.int64), np.zeros(8, np.int64)
        self._jobs = np.zeros((PLANS, len(JOB)), np.int64)
        for plan in range(PLANS):
            arrays = (self._motor, self._regulator, self._start, self._states)
            motor, regulator, start, states = (array[plan].ctypes.data for array in arrays)
            self._jobs[plan] = (
                *(rows + 1, 0, self._time.ctypes.data, motor, regulator),
                *(plant.table.ctypes.data, start, states),
            )
        shared = self._jobs, self._taken, self._attempts
        self._addresses = [array.ctypes.data for array in shared]

    def __deepcopy__(self, memo: dict[int, object]) -> "Prediction":
        """One with arrays of its own; the compiled plant never changes and is shared."""
        return Prediction(self.plant, self._time)

    def __call__(
        self, condition: Condition, commands: Commands, plans: int
    ) -> dict[str, NDArray[np.float64]]:
        """True outputs at the end of every row.

        Args:
            condition: where the plant stands; stays as it is.
            commands: in force in every row (V), for as many plans.
            plans: how many, 16 at most.
        Returns:
            contraction (m), rotation (rad), load (N), pressure (Pa) and extension (m), of shape
            (plans, rows) each, until the next call.
        """
        zero, count = condition.zero_contraction, len(self.plant.states)
        self._motor[:plans, :-1], self._regulator[:plans, :-1] = commands
        self._start[:plans, :count] = condition.state
        self._start[:plans, count:] = condition.size, zero
        program = self.plant.program
        self._taken[0] = 0
        program.simulate_many(plans, *self._addresses)
        program.observe(
            plans * (self.rows + 1),
            self._states.ctypes.data,
            zero,
            self.plant.vector.ctypes.data,
            self._outputs.ctypes.data,
        )
        seen = {name: self._outputs[:plans, 1:, i] for i, name in enumerate(self.plant.outputs)}
        seen["extension"] = zero - seen["contraction"]
        return seen


PUSHES_V = np.append(0.0, np.geomspace(0.01, 10.0, 13))
"""Pushes of a loose cable that are tried, beyond where the drive begins to pull (V)."""


class Oracle:
    """Predictive control with the true station and state; a bound, not a rival.

    It drives no real station: it receives the environment (`receive`) before each `reset`.

    Example:
        >>> from pma_gym.envs import PMAEnv
        >>> env, ended = PMAEnv("displacement", pressure_kpa=300), False
        >>> observation, info = env.reset(seed=1)
        >>> oracle = Oracle()
        >>> oracle.receive(env)
        >>> oracle.reset(env.reference, env.station)
        >>> while not ended:
        ...     volts = oracle.act(env.measurement, env.time)
        ...     _, _, terminated, ended, info = env.step(env.action(volts))
        >>> bool(info["rmse_mm"] < 0.01)
        True
    """

    name = "oracle"

    def __init__(self) -> None:
        self._environment: PMAEnv | None = None

    def receive(self, environment: "PMAEnv") -> None:
        """Receive the environment to drive, after that environment was reset."""
        self._environment = environment

    def __deepcopy__(self, memo: dict[int, object]) -> "Oracle":
        """A copy with a plan of its own that is shown the same environment."""
        memo[id(self._environment)] = self._environment
        copied = Oracle()
        copied.__dict__ |= copy.deepcopy(self.__dict__, memo)
        return copied

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Read the true station and prepare its inverse.

        Raises:
            ValueError: it was not shown the environment.
        """
        environment = self._seen()
        plant, schedule = environment.plant, station.task.schedule
        self._regulates = station.task.actuator == "regulator"
        self._period, self._unit = station.period, SI_FACTORS[schedule.unit]
        self._quantity = schedule.quantity
        delay = round(station.action_delay / station.period)
        # Commands on their way are the first of every plan, and fixed.
        self._sent = np.full(delay, self._delayed(environment))
        self._horizon = ahead = horizon(station.period, delay)
        times = station.period * (delay + np.append(-delay, ahead.ends / ahead.parts))
        self._prediction = Prediction(plant, times)
        needed = nominal_motion(reference, replace(station, model=plant.model)).volts
        self._zero = self._position_at_zero(environment)
        self._low = 0.0 if self._regulates else self._idle_voltage(environment)
        self._space = Space(ahead.blocks, self._low, VOLTAGE_LIMIT)
        self._tabulate(needed.clip(self._low, VOLTAGE_LIMIT), reference, station)
        self._plan = self._needed[delay : delay + len(ahead.blocks)]

    def _tabulate(
        self, needed: NDArray[np.float64], reference: Reference, station: StationInfo
    ) -> None:
        """Keep inverse and reference of the whole trial, and of a horizon beyond its end."""
        ahead, delay = self._horizon, len(self._sent)
        self._needed = np.append(needed, np.full(delay + len(ahead.blocks) + 1, needed[-1]))
        count = ahead.parts * len(self._needed)
        times = station.period / ahead.parts * np.arange(count + 1)
        self._targets = np.array([reference(time) for time in times.tolist()])
        self._counts = np.where(times <= station.task.duration + 1e-9, 1.0 / self._unit, 0.0)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) of the task's actuator, in force after the action delay."""
        begin = round(time / self._period) + len(self._sent)
        end = begin + len(self._plan)
        errors = self._errors(self._seen(), begin)
        others = self._other_plans(self._needed[begin:end], self._seen().truth["load"] <= 0.0)
        plan = best_plan(errors, self._plan, others, self._space)
        voltage = float(plan[0])
        # The same for the periods from the next one on; what the inverse needs goes on at the end.
        following = plan[-1] + self._needed[end] - self._needed[end - 1]
        self._plan = np.append(plan[1:], min(max(following, self._low), VOLTAGE_LIMIT))
        self._sent = np.append(self._sent, voltage)[1 : len(self._sent) + 1]
        return voltage

    def _other_plans(self, needed: NDArray[np.float64], loose: bool) -> NDArray[np.float64]:
        """Other plans to begin with, besides the one of the period before.

        The inverse's, as it is and from the voltage planned now; where the cable is loose also some
        with a push of a period, from one that only just moves the rotor on.
        """
        plans = [needed, needed + (self._plan[0] - needed[0])]
        if loose:
            pushed = np.tile(self._plan, (2 * len(PUSHES_V), 1))
            pushed[:, 0] = self._low + np.tile(PUSHES_V, 2)
            pushed[len(PUSHES_V) :, 1] = self._low
            plans.extend(pushed)
        return np.clip(plans, self._low, VOLTAGE_LIMIT)

    def _errors(self, environment: "PMAEnv", begin: int) -> Errors:
        """Errors (mm or deg) of plans from where the plant stands, at the scored times ahead."""
        condition, jump = environment.condition, environment.disturbance[0]
        motor, regulator = environment.motor_voltage, environment.regulator_voltage
        ahead, delay = self._horizon, len(self._sent)
        at = ahead.parts * begin + ahead.ends
        targets, weights = self._zero + self._targets[at], ahead.weights * self._counts[at]
        volts = np.empty((PLANS, delay + len(self._plan)))
        volts[:, :delay] = self._sent

        def errors(plans: NDArray[np.float64]) -> NDArray[np.float64]:
            parts = [predicted(plans[k : k + PLANS]) for k in range(0, len(plans), PLANS)]
            return (np.concatenate(parts) - targets) * weights

        def predicted(plans: NDArray[np.float64]) -> NDArray[np.float64]:
            volts[: len(plans), delay:] = plans
            by_period = volts[: len(plans), ahead.periods]
            if self._regulates:
                commands = Commands(motor, (by_period + jump).clip(0.0, VOLTAGE_LIMIT))
            else:
                commands = Commands(by_period, regulator)
            # A copy: the next prediction is written over it.
            return self._prediction(condition, commands, len(plans))[self._quantity].copy()

        return errors

    def _delayed(self, environment: "PMAEnv") -> float:
        """What the actuator hears now (V)."""
        return environment.regulator_voltage if self._regulates else environment.motor_voltage

    def _position_at_zero(self, environment: "PMAEnv") -> float:
        """The plant's output (m or rad) where the task counts the position as 0."""
        condition = environment.condition
        seen = environment.plant.observe(condition.state[None, :], condition.zero_contraction)
        return float(seen[self._quantity][0]) - environment.position

    def _idle_voltage(self, environment: "PMAEnv") -> float:
        """Highest motor voltage (V) that does no more than none: where the drive begins to pull.

        Below it the position has no slope, and the search would never push a loose cable.
        """
        low, high = 0.0, VOLTAGE_LIMIT
        for _ in range(4):
            volts = np.linspace(low, high, PLANS)
            commands = Commands(volts[:, None], environment.regulator_voltage)
            reached = self._prediction(environment.condition, commands, PLANS)[self._quantity]
            moved = np.abs(reached[:, -1] - reached[0, -1]) > 1e-6 * self._unit
            first = max(1, int(np.argmax(moved)))
            low, high = float(volts[first - 1]), float(volts[first])
        return low

    def _seen(self) -> "PMAEnv":
        if self._environment is None:
            raise ValueError(
                "oracle must be shown the environment, whose true station it knows; call "
                "receive(environment) before reset, or take a controller that needs only sensors"
            )
        return self._environment
