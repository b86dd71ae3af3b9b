"""What a controller of any rig has, and the lever by which it moves the task's signal."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.rigs.nominal_rig import NominalRig
from pma_gym.envs import RigInfo

Array = NDArray[np.float64]


class RigMeasurement(NamedTuple):
    """What a controller receives in a control step.

    Attributes:
        values: measured signals (SI) by name.
        observation: what a policy sees, as the environment has it.
        time: time since the trial began (s).
    """

    values: Mapping[str, float]
    observation: NDArray[np.float32]
    time: float


class RigController(ABC):
    """A controller of any rig; its settings are positive numbers, found by a search.

    Attributes:
        name: in tables.
        settings: names of its settings, with where the search begins.
    """

    name: ClassVar[str]
    settings: ClassVar[Mapping[str, float]] = {}

    def __init__(self, settings: Mapping[str, float]) -> None:
        """Keep the settings."""
        self.chosen = dict(settings)

    @classmethod
    def missing(cls, info: RigInfo) -> str:
        """What a rig lacks for it, in words; "" where it applies."""
        return ""

    @abstractmethod
    def reset(self, info: RigInfo) -> None:
        """Prepare for a trial on a rig, whose task has the reference."""

    @abstractmethod
    def act(self, measurement: RigMeasurement) -> Sequence[float]:
        """Commands (SI) to hold for the next control period, in the order of the rig's."""
        ...


PUSH_S = 0.2
"""How long commands are held to see which of them move the task's signal (s)."""

LEAST_SHARE = 0.3
"""Share of the strongest command's effect that another must have to move with it."""

NO_EFFECT = 1e-6
"""Share of the task's range below which what a command's whole range does is nothing."""


class Lever:
    """One number, -1 to 1, that moves the commands which move the task's signal.

    Commands of like effect move together, each in its direction: two pressures of muscles against
    each other by their difference. The others stay at rest.

    Args:
        info: the rig.
        rig: its nominal plant.
    """

    def __init__(self, info: RigInfo, rig: NominalRig) -> None:
        limits = np.array([command.limits for command in info.commands])
        self.low, self.high = limits.T
        self.rest = np.array(rig.rest)
        effects = np.array([self._effect(rig, at) for at in range(len(limits))])
        share = effects / max(np.abs(effects).max(), NO_EFFECT * info.task.schedule.span)
        moves = np.where(np.abs(share) >= LEAST_SHARE, np.sign(share), 0.0)
        reach = np.maximum(self.high - self.rest, self.rest - self.low)
        self.step = moves * reach

    def _effect(self, rig: NominalRig, at: int) -> float:
        """What 5 % more of one command does to the task's signal."""
        pushed = self.rest.copy()
        room = 0.05 * (self.high[at] - self.low[at])
        pushed[at] += room if pushed[at] + room <= self.high[at] else -room
        start = rig.start()
        moved = rig.held(start, pushed, PUSH_S)[0] - rig.held(start, self.rest, PUSH_S)[0]
        return moved / (pushed[at] - self.rest[at]) * (self.high[at] - self.low[at])

    def commands(self, share: float | Array) -> Array:
        """Commands (SI) for a number from -1 to 1, or one for each command."""
        return np.clip(self.rest + share * self.step, self.low, self.high)
