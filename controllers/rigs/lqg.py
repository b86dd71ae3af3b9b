"""Linear quadratic Gaussian control of any rig along its nominal motion."""

from collections.abc import Sequence
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.rigs.feedforward import Feedforward, NominalMotion, PlanKey, key_of, plan_of
from controllers.rigs.nominal_rig import NominalRig
from controllers.rigs.rig_controller import RigMeasurement
from pma_gym.data.signals import is_pressure
from pma_gym.envs import RigInfo
from pma_gym.plant import sensors
from pma_gym.plant.forms.linear import following

NUDGE, PRESSURE = 1e-6, 1e8
"""Step of the differences (SI), and how many times more that of a pressure is, whose unit it is."""

SMALL = 1e-3
"""Step of the lever."""

LEAST_SHAKEN = 1e-9
"""Least variance of what shakes a state."""

SETTLING = 200
"""Steps from which the filter's variance is about steady where an episode begins."""

Array = NDArray[np.float64]


def inputs_of(plan: NominalMotion, separate: bool) -> tuple[Array, Array, Array]:
    """Inputs in shares of the lever: it, or by itself every command that moves in the plan.

    Returns:
        Commands that each input moves, shape (commands, inputs); least and greatest inputs.
    """
    lever = plan.lever
    if not separate:
        return np.ones((len(lever.step), 1)), -np.ones(1), np.ones(1)
    moved = np.ptp([lever.commands(share) for share in plan.shares], axis=0) > 0.0
    moved = moved if moved.any() else lever.step != 0.0
    ends = (np.stack([lever.low, lever.high]) - lever.rest)[:, moved] / lever.step[moved]
    return np.eye(len(moved))[:, moved], *np.sort(ends, axis=0)


class LinearMotion(NamedTuple):
    """Linear systems of the nominal rig in discrete time, at every control step of its motion.

    Units are SI, of pressures 100 MPa, of inputs shares of the lever.

    Attributes:
        a: states by states, shape (steps, n, n).
        b: states by inputs, shape (steps, n, m).
        c: measured signals by states, one step more, shape (steps + 1, signals, n).
    """

    a: Array
    b: Array
    c: Array


@lru_cache(maxsize=64)
def linear_motion(key: PlanKey, separate: bool) -> LinearMotion:
    """The linear systems along a plan, made once.

    States of friction and sensors are as in the plan: the rig slides.
    """
    info, plan = key.info, plan_of(key)
    rig, lever = NominalRig(info), plan.lever
    groups, low, high = inputs_of(plan, separate)
    plant, zero = rig.plant, plan.conditions[0].zero_contraction
    kept = [
        i
        for i, name in enumerate(plant.states)
        if name in following(plant) or not name.startswith(("memory_", "lag_"))
    ]
    units = np.array([PRESSURE if is_pressure(plant.states[i]) else 1.0 for i in kept])
    states = np.array([each.state for each in plan.conditions])
    shares = np.clip(np.append(plan.shares, plan.shares[-1])[:, None], low, high)

    def inputs(shares: Array) -> Array:
        return np.array([rig.inputs(row) for row in lever.commands(shares @ groups.T)]).T

    def rates(states: Array, inputs: Array) -> Array:
        return plant.derivative(states, inputs[0], inputs[1], zero)[:, kept] / units

    def signals(states: Array) -> Array:
        seen = plant.observe(states, zero)
        return np.stack([seen[name] for name in info.signals], axis=1)

    n, m, middle = len(kept), len(low), inputs(shares)
    rest, whole = rates(states, middle), np.zeros((len(states), n + m, n + m))
    c = np.empty((len(states), len(info.signals), n))
    for j, (i, unit) in enumerate(zip(kept, units, strict=True)):
        move = np.zeros(len(plant.states))
        move[i] = NUDGE * unit
        pair = states + move, states - move
        whole[:, :n, j] = (rates(pair[0], middle) - rates(pair[1], middle)) / (2.0 * NUDGE)
        c[:, :, j] = (signals(pair[0]) - signals(pair[1])) / (2.0 * NUDGE)
    for j, one in enumerate(np.eye(m)):
        # At an end of its range a command may go one way alone.
        up, down = ((rates(states, inputs(shares + s * one)) - rest) / s for s in (SMALL, -SMALL))
        stronger = np.abs(up).max(axis=1) >= np.abs(down).max(axis=1)
        whole[:, :n, n + j] = np.where(stronger[:, None], up, down)
    held = _exponentials(whole * info.period)
    return LinearMotion(held[:-1, :n, :n], held[:-1, :n, n:], c)


def _exponentials(stack: Array) -> Array:
    """E to each of many small matrices, by squaring."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(stack).sum(axis=2).max(), 1e-9)))) + 6)
    small, one = stack / 2.0**halvings, np.eye(stack.shape[1])
    series = one + small @ (one + small / 2.0 @ (one + small / 3.0 @ (one + small / 4.0)))
    return np.linalg.matrix_power(series, 2**halvings)


class RigLQG(Feedforward):
    """Feedback on the deviation from the plan, estimated with a force that the model lacks.

    The nominal rig, linearised along the plan, in discrete time, with inputs that an unknown number
    moves which drifts; its estimate is taken off again, so that nothing remains at rest. Gains of
    feedback and filter are those of the trial's time.

    Source:
        G. F. Franklin, J. D. Powell and M. Workman 1998, "Digital Control of Dynamic Systems",
        chapter 9; the disturbance's estimate: section 8.5.
    """

    name = "lqg"
    settings = {"effort": 0.1, "disturbance": 1.0, "process": 0.1}
    separate: ClassVar[bool] = False
    """Whether every command is an input by itself."""

    def reset(self, info: RigInfo) -> None:
        """NominalMotion the trial, and design gains and filter."""
        super().reset(info)
        a, b, c = linear_motion(key_of(info), self.separate)
        self._groups, self._low, self._high = inputs_of(self.plan, self.separate)
        self._measures, self._late = info.signals, round(info.observation_delay / info.period)
        effort, disturbance, process = (self.chosen[name] for name in self.settings)
        (steps, n, m), queue = b.shape, b.shape[2] * (self._early + self._late)
        # All inputs that move alike cost what the lever costs.
        self._price = effort**2 / m * np.eye(m)
        followed = c[:, info.signals.index(info.task.schedule.quantity)] / info.task.schedule.span
        self._costs, self._gains = np.zeros((steps + 1, n, n)), np.zeros((steps, m, n))
        for k in reversed(range(steps)):
            after = self._costs[k + 1] + np.outer(followed[k + 1], followed[k + 1])
            by = b[k].T @ after
            self._gains[k] = np.linalg.solve(self._price + by @ b[k], by @ a[k])
            self._costs[k] = a[k].T @ after @ (a[k] - b[k] @ self._gains[k])
        # States, the unknown part of the inputs, then inputs that are on their way.
        whole = np.zeros((steps, n + 1 + queue, n + 1 + queue))
        self._enters, together = np.zeros((steps, n + 1 + queue, m)), b.sum(axis=2)
        whole[:, :n, :n], whole[:, :n, n], whole[:, n, n] = a, together, 1.0
        if queue:
            whole[:, :n, n + 1 : n + 1 + m] = b
            whole[:, n + 1 : -m, n + 1 + m :] = np.eye(queue - m)
            self._enters[:, -m:] = np.eye(m)
        else:
            self._enters[:, :n] = b
        shaken = np.tile(LEAST_SHAKEN * np.eye(n + 1 + queue), (steps, 1, 1))
        # A model is wrong by itself where each command acts.
        each = linear_motion(key_of(info), True).b
        shaken[:, :n, :n] += process**2 * each @ each.transpose(0, 2, 1)
        shaken[:, n, n] = disturbance**2 * info.period
        noise = np.diag(self._noise(info) ** 2)
        self._seen = np.concatenate([c, np.zeros((*c.shape[:2], 1 + queue))], axis=2)
        spread, filters = shaken[0], []
        for k in [0] * SETTLING + [*range(steps)]:
            seen = self._seen[k] @ spread
            filters.append(np.linalg.solve(seen @ self._seen[k].T + noise, seen).T)
            left = np.eye(len(spread)) - filters[-1] @ self._seen[k]
            spread = left @ spread @ left.T + filters[-1] @ noise @ filters[-1].T
            spread = whole[k] @ spread @ whole[k].T + shaken[k]
        self._filters, self._whole = filters[SETTLING:], whole
        self._estimate = np.zeros(n + 1 + queue)

    def _noise(self, info: RigInfo) -> Array:
        """Standard deviations of the readings (SI), a ten-thousandth of their range at least."""
        rig = info.model.rig
        known = dict(zip(rig.outputs, sensors.deviations(info.model), strict=True))
        has_sensor = {s.name for s in rig.signals if s.sensor in info.model.parameters}
        return np.array(
            [
                max(
                    known[name] if name in has_sensor else 0.0,
                    1e-4 * float(np.ptp(self.plan.signals[name])),
                    NUDGE * (PRESSURE if is_pressure(name) else 1.0),
                )
                for name in info.signals
            ]
        )

    def act(self, measurement: RigMeasurement) -> Sequence[float]:
        """Commands (SI)."""
        last, now = len(self._whole) - 1, round(measurement.time / self._period)
        at = max(now - self._late, 0)
        off = [measurement.values[name] - self.plan.signals[name][at] for name in self._measures]
        self._estimate += self._filters[at] @ (off - self._seen[at] @ self._estimate)
        # Where the rig will be when these inputs arrive.
        arrived, n = self._estimate, self._gains.shape[2]
        for k in range(at, at + self._early + self._late):
            arrived = self._whole[min(k, last)] @ arrived
        planned = np.clip(self.share(measurement.time), self._low, self._high)
        arrival = min(now + self._early, last)
        moved = self._moved(arrival, planned, arrived[:n], float(arrived[n]))
        self._estimate = self._whole[at] @ self._estimate + self._enters[at] @ moved
        return self.plan.lever.commands(self._groups @ (planned + moved)).tolist()

    def _moved(self, arrival: int, planned: Array, off: Array, unknown: float) -> Array:
        """Inputs beside the plan's.

        Args:
            arrival: step in which they arrive.
            planned: of the plan.
            off: the states' deviation then.
            unknown: part of the inputs.
        """
        whole = planned - self._gains[arrival] @ off - unknown
        return np.clip(whole, self._low, self._high) - planned
