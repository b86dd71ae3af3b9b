"""Linear quadratic Gaussian control of any rig about its nominal motion."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from controllers.rigs.feedforward import Feedforward
from controllers.rigs.nominal_rig import NominalRig
from controllers.rigs.rig_controller import Lever, RigMeasurement
from pma_gym.data.signals import is_pressure
from pma_gym.envs import RigInfo
from pma_gym.plant import sensors
from pma_gym.plant.forms.linear import following

NUDGE = 1e-6
"""Step of the differences (SI); of a pressure a hundred million times more."""

SMALL = 1e-3
"""Step of the lever."""

LEAST_WEIGHT = 1e-9
"""Least weight of a state, and least variance of what shakes it."""

Array = NDArray[np.float64]


def linear_rig(info: RigInfo, rig: NominalRig, lever: Lever) -> tuple[Array, Array, Array]:
    """A, b and C of the nominal rig where episodes begin, in discrete time.

    States of friction and sensors are constant: the rig slides.

    Returns:
        States by states and by the lever; measured signals by states.
    """
    plant, start = rig.plant, rig.start()
    kept = [
        i
        for i, name in enumerate(plant.states)
        if name in following(plant) or not name.startswith(("memory_", "lag_"))
    ]

    def rates(state: Array, share: float = 0.0) -> Array:
        inputs = rig.inputs(lever.commands(share))
        return plant.derivative(state, *inputs, start.zero_contraction)[kept]

    def signals(state: Array) -> Array:
        seen = plant.observe(state[None, :], start.zero_contraction)
        return np.array([seen[name][0] for name in info.signals])

    slopes, outputs = [], []
    for i in kept:
        move = np.zeros(len(plant.states))
        move[i] = NUDGE * (1e8 if is_pressure(plant.states[i]) else 1.0)
        pairs = start.state + move, start.state - move
        for rows, law in ((slopes, rates), (outputs, signals)):
            rows.append((law(pairs[0]) - law(pairs[1])) / (2.0 * move[i]))
    # From rest the lever may go one way alone.
    ways = [(rates(start.state, s) - rates(start.state)) / s for s in (SMALL, -SMALL)]
    b = max(ways, key=lambda way: float(np.abs(way).max()))
    n = len(kept)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = np.transpose(slopes), b
    step = np.asarray(expm(whole * info.period), float)
    return step[:n, :n], step[:n, n], np.transpose(outputs)


class RigLQG(Feedforward):
    """Feedback on the deviation from the plan, estimated with a force that the model lacks.

    The nominal rig, linearised where episodes begin, in discrete time, with a lever that an unknown
    number moves which drifts; its estimate is taken off again, so that nothing remains at rest.

    Source:
        G. F. Franklin, J. D. Powell and M. Workman 1998, "Digital Control of Dynamic Systems",
        chapter 9; the disturbance's estimate: section 8.5.
    """

    name = "lqg"
    settings = {"effort": 0.1, "disturbance": 1.0, "process": 0.01}

    def reset(self, info: RigInfo) -> None:
        """NominalMotion the trial, and design gain and filter."""
        super().reset(info)
        a, b, c = linear_rig(info, NominalRig(info), self.plan.lever)
        self._measures, n = info.signals, len(a)
        self._late = round(info.observation_delay / info.period)
        delay = self._early + self._late
        # States, the lever's unknown part, then levers that are on their way.
        whole, enters = np.zeros((n + 1 + delay, n + 1 + delay)), np.zeros(n + 1 + delay)
        whole[:n, :n], whole[:n, n], whole[n, n] = a, b, 1.0
        if delay:
            whole[:n, n + 1] = b
            whole[n + 1 : -1, n + 2 :] = np.eye(delay - 1)
            enters[-1] = 1.0
        else:
            enters[:n] = b
        effort, disturbance, process = (self.chosen[name] for name in self.settings)
        followed = c[info.signals.index(info.task.schedule.quantity)] / info.task.schedule.span
        weight = np.outer(followed, followed) + LEAST_WEIGHT * np.diag(followed @ followed + 0 * b)
        costs = solve_discrete_are(a, b[:, None], weight, [[effort**2]])
        self._gain = (b @ costs @ a) / (effort**2 + b @ costs @ b)
        shaken = LEAST_WEIGHT * np.eye(len(whole))
        shaken[:n, :n] += process**2 * np.outer(b, b)
        shaken[n, n] = disturbance**2 * info.period
        noise = np.diag(self._noise(info) ** 2)
        seen = np.hstack([c, np.zeros((len(c), 1 + delay))])
        spread = solve_discrete_are(whole.T, seen.T, shaken, noise)
        self._filter = spread @ seen.T @ np.linalg.inv(seen @ spread @ seen.T + noise)
        self._whole, self._enters, self._seen = whole, enters, seen
        self._estimate, self._ahead = np.zeros(len(whole)), np.linalg.matrix_power(whole, delay)

    def _noise(self, info: RigInfo) -> Array:
        """Standard deviations of the readings (SI), a ten-thousandth of the range at least."""
        known = dict(zip(info.model.rig.outputs, sensors.deviations(info.model), strict=True))
        has_sensor = {s.name for s in info.model.rig.signals if s.sensor in info.model.parameters}
        least = 1e-4 * info.task.schedule.span
        return np.array([max(known[n], least) if n in has_sensor else least for n in info.signals])

    def act(self, measurement: RigMeasurement) -> Sequence[float]:
        """Commands (SI)."""
        at = max(round(measurement.time / self._period) - self._late, 0)
        off = [measurement.values[name] - self.plan.signals[name][at] for name in self._measures]
        self._estimate += self._filter @ (off - self._seen @ self._estimate)
        # Where the rig will be when this lever arrives.
        arrived, n = self._ahead @ self._estimate, len(self._gain)
        planned = self.share(measurement.time)
        share = float(np.clip(planned - self._gain @ arrived[:n] - arrived[n], -1.0, 1.0))
        self._estimate = self._whole @ self._estimate + self._enters * (share - planned)
        return self.plan.lever.commands(share).tolist()
