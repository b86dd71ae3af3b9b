"""Rewards of a step, by name."""

from collections.abc import Callable
from typing import Any

from pma_gym.codegen.generic import where
from pma_gym.effects.arithmetic import exponential


def absolute_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """Minus the absolute error in percent of the range: -|e|."""
    return -abs(error_percent)


def quadratic_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """Minus the squared error in percent of the range: -e^2."""
    return -error_percent * error_percent


def gaussian_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """exp(-e^2) of the error in percent of the range, between 0 and 1; 0 beyond e^2 = 12."""
    square = error_percent * error_percent
    near = square < GAUSSIAN_END
    return where(near, exponential(-where(near, square, 0.0)), 0.0)


def smooth_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """The absolute reward less a tenth of the action's change: -|e| - 0.1 |da|."""
    return -abs(error_percent) - 0.1 * abs(change)


GAUSSIAN_END = 12.0
"""Squared error beyond which the gaussian reward is 0, where it would be 6e-6."""


Reward = Callable[[Any, Any], Any]
"""Reward of a step: of the true error at its end (percent of range), and of the largest change
of an action (which runs from -1 to 1) since the step before. Written in the arithmetic of laws, so
that kernels compute it too."""

REWARDS: dict[str, Reward] = {
    "absolute": absolute_reward,
    "quadratic": quadratic_reward,
    "gaussian": gaussian_reward,
    "smooth": smooth_reward,
}
"""Rewards by name."""


def missed_reward(reward: Reward) -> float:
    """Reward of each step that a terminated episode did not reach: an error of the whole range.

    Following badly to the end is worth more, so that breaking the rig never pays.
    """
    return reward(100.0, 0.0)
