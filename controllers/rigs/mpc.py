"""Model predictive control of any rig: the best commands of the coming periods within limits."""

import numpy as np

from controllers.design.quadratic_program import BoundedProgram, imported_osqp
from controllers.rigs.feedforward import key_of
from controllers.rigs.lqg import Array, RigLQG, linear_motion
from controllers.rigs.nominal_rig import NominalRig
from controllers.rigs.rig_controller import Lever
from pma_gym.envs import RigInfo

HORIZON = 25
"""Control periods that are looked ahead."""

LASTING = 0.5
"""Share of the unknown part that counts at the limits one period further ahead: it is what the
model gets wrong of this moment, and of another one something else."""


class RigMPC(RigLQG):
    """Commands of the coming periods that follow the reference best within the commands' limits.

    From the estimate of the LQG's filter the error at the ends of the coming N periods is foreseen
    along the plan, linear in what its commands become beside it, each command by itself:

        min  sum of (e_i / span)^2 + effort^2 / m * |w_i|^2, and the LQG's costs of the last state
        low <= plan + w - d_i <= high

    with d_i what takes the estimated unknown force off, m the number of commands. The first ones
    are sent. If no limit is met, this is the LQG with the reference in its preview.

    Source:
        J. B. Rawlings, D. Q. Mayne and M. M. Diehl 2017, "Model predictive control", chapter 1.
    """

    name = "mpc"
    separate = True

    @classmethod
    def missing(cls, info: RigInfo) -> str:
        """What a rig lacks for it, in words; "" where it applies."""
        try:
            imported_osqp()
        except ImportError as error:
            return str(error)
        moves = Lever(info, NominalRig(info)).step.any()
        return "" if moves else f"no command moves {info.task.schedule.quantity} from rest"

    def reset(self, info: RigInfo) -> None:
        """Foresee the trial: how commands act along the plan."""
        super().reset(info)
        a, b, c = linear_motion(key_of(info), self.separate)
        (steps, n, m), schedule = b.shape, info.task.schedule
        at = np.minimum(np.arange(steps)[:, None] + np.arange(HORIZON), steps - 1)
        followed = c[1:, info.signals.index(schedule.quantity)] / schedule.span
        reference = schedule.reference(np.arange(1, steps + 1) * info.period)
        self._missed = ((self.plan.signals[schedule.quantity][1:] - reference) / schedule.span)[at]
        states = np.zeros((steps, n, n + HORIZON * m))
        states[:, :, :n], rows = np.eye(n), []
        for i in range(HORIZON):
            states = a[at[:, i]] @ states
            states[:, :, n + i * m : n + (i + 1) * m] = b[at[:, i]]
            rows.append(followed[at[:, i], None, :] @ states)
        values, vectors = np.linalg.eigh(self._costs[at[:, -1] + 1])
        roots = np.sqrt(np.maximum(values, 0.0))[:, :, None] * vectors.transpose(0, 2, 1)
        self._foreseen = np.concatenate([*rows, roots @ states], axis=1)
        shares = np.clip(self.plan.shares[:, None], self._low, self._high)
        self._planned = shares[at].reshape(steps, -1)
        self._prices = np.kron(np.eye(HORIZON), self._price)
        self.program = BoundedProgram(HORIZON * m)

    def _moved(self, arrival: int, planned: Array, off: Array, unknown: float) -> Array:
        """First inputs beside the plan's of those that minimise."""
        free, acts = np.split(self._foreseen[arrival], [len(off)], axis=1)
        missed = free @ off
        missed[:HORIZON] += self._missed[arrival]
        lasting = np.repeat(unknown * LASTING ** np.arange(HORIZON), len(planned))
        ends = (np.tile(each, HORIZON) for each in (self._low, self._high))
        limits = (end - self._planned[arrival] + lasting for end in ends)
        best = self.program.solve(acts.T @ acts + self._prices, acts.T @ missed, *limits)
        if best is None:
            return super()._moved(arrival, planned, off, unknown)
        return best[: len(planned)] - unknown
