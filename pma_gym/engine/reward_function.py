"""Signature of a user's reward function, and its check."""

import inspect
from collections.abc import Callable
from typing import Protocol


class RewardFunction(Protocol):
    """Reward of a step: a function of four floats that returns a finite number.

    The arguments are positional, in this order:

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
    """Reject a value that cannot be called with four numbers.

    Raises:
        ValueError: with the rule and the value.
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
