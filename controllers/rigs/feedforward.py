"""Feed-forward from any rig's nominal model: the commands with which it would follow by itself."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.rigs.nominal_rig import NominalRig
from controllers.rigs.rig_controller import Lever, RigController, RigMeasurement
from pma_gym.envs import RigInfo
from pma_gym.plant.statics import Condition

HORIZONS = (1, 2, 4, 8, 16)
"""Control periods ahead at which the nominal rig shall meet the reference; the best is taken."""

NUDGE = 0.02
"""Change of the lever from which its effect is taken."""


class NominalMotion(NamedTuple):
    """How the nominal rig follows.

    Attributes:
        lever: what moves it.
        shares: lever in every control step, shape (steps,).
        conditions: at the control steps, one more than them.
        signals: true signals (SI) at the control steps, by name.
        error: root mean square of what it misses (SI).
    """

    lever: Lever
    shares: NDArray[np.float64]
    conditions: list[Condition]
    signals: dict[str, NDArray[np.float64]]
    error: float


def plan(info: RigInfo) -> NominalMotion:
    """The best plan over the horizons."""
    rig = NominalRig(info)
    lever = Lever(info, rig)
    return min((_planned(info, rig, lever, ahead) for ahead in HORIZONS), key=lambda p: p.error)


def _planned(info: RigInfo, rig: NominalRig, lever: Lever, ahead: int) -> NominalMotion:
    """Meet the reference some periods ahead, again and again, by commands that are held till there.

    Source:
        J. Richalet and D. O'Donovan 2009, "Predictive Functional Control", one coincidence point.
    """
    period, schedule = info.period, info.task.schedule
    steps = info.task.steps(1.0 / period)
    references = schedule.reference(np.arange(steps + ahead + 1) * period)
    condition, share, shares = rig.start(), 0.0, np.zeros(steps)
    conditions = [condition]
    for k in range(steps):
        pair = (share, share + (NUDGE if share < 0.0 else -NUDGE))
        ends = [rig.held(condition, lever.commands(s), ahead * period)[0] for s in pair]
        slope = (ends[1] - ends[0]) / (pair[1] - pair[0])
        # Until the first command arrives the rig is at rest.
        if k * period >= info.action_delay - 1e-9 and slope != 0.0 and np.isfinite(slope):
            share = float(np.clip(share + (references[k + ahead] - ends[0]) / slope, -1.0, 1.0))
        shares[k] = share
        _, condition = rig.held(condition, lever.commands(share), period)
        conditions.append(condition)
    seen = [rig.seen(each) for each in conditions]
    signals = {name: np.array([each[name] for each in seen]) for name in seen[0]}
    missed = signals[rig.followed] - references[: steps + 1]
    error = float(np.sqrt(np.mean(missed**2)))
    return NominalMotion(
        lever, shares, conditions, signals, error if np.isfinite(error) else np.inf
    )


class PlanKey(NamedTuple):
    """What a plan depends on; two episodes of one reference share theirs."""

    text: tuple[object, ...]
    info: RigInfo

    def __hash__(self) -> int:
        return hash(self.text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PlanKey) and self.text == other.text


def key_of(info: RigInfo) -> PlanKey:
    """What the plan of a rig and a task depends on."""
    times = np.arange(info.task.steps(1.0 / info.period)) * info.period
    text = (
        *(info.model.plant, tuple(info.model.parameters), info.model.vector().tobytes()),
        *(info.task.schedule.quantity, info.task.schedule.reference(times).tobytes()),
        *(
            info.period,
            info.action_delay,
            tuple(info.rest),
            tuple(command.limits for command in info.commands),
        ),
    )
    return PlanKey(text, info)


@lru_cache(maxsize=64)
def plan_of(key: PlanKey) -> NominalMotion:
    """The plan of a rig and a task, made once."""
    return plan(key.info)


class Feedforward(RigController):
    """Commands by time alone, as the nominal rig needs them; early by the commands' delay."""

    name = "feedforward"

    def reset(self, info: RigInfo) -> None:
        """NominalMotion the trial."""
        self.plan, self._period = plan_of(key_of(info)), info.period
        self._early = round(info.action_delay / info.period)

    def act(self, measurement: RigMeasurement) -> Sequence[float]:
        """Commands (SI) of the plan."""
        return self.plan.lever.commands(self.share(measurement.time)).tolist()

    def share(self, time: float) -> float:
        """Lever at a time (s)."""
        at = min(round(time / self._period) + self._early, len(self.plan.shares) - 1)
        return float(self.plan.shares[at])
