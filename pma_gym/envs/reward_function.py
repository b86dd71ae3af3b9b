"""Rewards by a user's own function, called after every step."""

import inspect
import math
import numbers
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from pma_gym.units import SI_FACTORS

if TYPE_CHECKING:
    from pma_gym.envs.engine import Engine


class RewardFunction(Protocol):
    """Reward of a step; four plain floats in, a finite number out.

    The arguments come by position, in this order:

    - the true error at the step's end, in percent of the task's range;
    - the largest change of an entry of the action (-1 to 1) since the step before;
    - the true position at the step's end, in the unit of the info (mm, deg or N m);
    - its reference then, in the same unit.
    """

    def __call__(
        self, error_percent: float, action_change: float, position: float, reference: float, /
    ) -> float:
        """The reward."""
        ...


RULE = (
    "a function of four numbers (error in percent of the range, change of the action, position, "
    "reference) that returns a finite number"
)


def check_reward_function(reward: Callable[..., object]) -> None:
    """Refuse what cannot be called with four numbers.

    Raises:
        ValueError: names the rule and what came.
    """
    try:
        signature = inspect.signature(reward)
    except (TypeError, ValueError):
        # A builtin may not say what it takes: its first call will.
        return
    try:
        signature.bind(0.0, 0.0, 0.0, 0.0)
    except TypeError as problem:
        raise ValueError(
            f"reward must be a name or {RULE}, got {reward!r}: {problem}; "
            "def reward(error_percent, action_change, position, reference): ..."
        ) from None


class FunctionRewards:
    """Writes the rewards of a user's function where an engine has its own.

    The compiled step leaves the action's change in their place (`Circuit.reward`). A terminated
    episode also gets, for every step that it did not reach, the reward of an error of the whole
    range, as with the rewards by name.

    Args:
        engine: whose rewards; its options have the function.
    """

    def __init__(self, engine: "Engine") -> None:
        task, options = engine.task, engine.options
        assert callable(options.reward)
        self._engine, self._reward, self._scale = engine, options.reward, options.reward_scale
        unit, quantity = task.protocol.suffix, task.protocol.quantity
        self._names = (f"error_{unit}", f"{quantity}_{unit}", f"reference_{unit}")
        self._span = task.protocol.span / SI_FACTORS[task.protocol.unit]

    def write(self, skipped: NDArray[np.int64] | Sequence[int] = ()) -> None:
        """Compute and write the rewards of the step that was made.

        Args:
            skipped: environments whose step means nothing, since it only begins an episode.
        Raises:
            ValueError: the function returned no finite number.
        """
        engine = self._engine
        columns = [engine.numbers(name).tolist() for name in ("reward", *self._names)]
        ended, counts = engine.numbers("ended").tolist(), engine.counts().tolist()
        left_out = set(np.asarray(skipped, int).tolist())
        place, width = engine.record.places["reward"], engine.width
        for i, (change, error, position, reference) in enumerate(zip(*columns, strict=True)):
            if i in left_out:
                continue
            missed = engine.horizon - counts[i] if ended[i] else 0
            value = self._of_step(change, error, position, reference, missed)
            engine.rewards[i] = engine.records[i // width, place, i % width] = value

    def _of_step(
        self, change: float, error: float, position: float, reference: float, missed: int
    ) -> float:
        value = self._call(100.0 * error / self._span, change, position, reference)
        if missed:
            value += missed * self._call(100.0, 0.0, reference + self._span, reference)
        return self._scale * value

    def _call(self, *given: float) -> float:
        value = self._reward(*given)
        is_number = isinstance(value, numbers.Real) and not isinstance(value, bool | np.bool_)
        if not is_number or not math.isfinite(value):
            error, change, position, reference = given
            raise ValueError(
                f"reward must be {RULE}; it returned {value!r} for error {error:g} %, change "
                f"{change:g}, position {position:g}, reference {reference:g}"
            )
        return float(value)
