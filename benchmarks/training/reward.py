"""The reward as policies learn from it: bounded below."""

from typing import Any

import numpy as np

LEAST_REWARD, BROKEN_REWARD = -10.0, -100.0
"""Least reward of a step that is learned from, and of one that breaks a limit.

Further from the reference than 10 % of the range, and after a limit, one is as bad as another. In
full, the first episodes' rewards (down to -150 000) would drown everything else: some trainings
then learn to stay at 0 V and never leave it.
"""


def bounded(rewards: Any, terminated: Any, scale: float = 1.0) -> Any:  # noqa: ANN401
    """Rewards as they are learned from; of numbers or arrays.

    Args:
        rewards: of the environment.
        terminated: whether a limit broke.
        scale: factor on what is left. Where errors stay large for many steps ahead, returns are
            hundreds, which a critic does not reach in time and which drown the policy's gradient.
    """
    return scale * np.maximum(rewards, np.where(terminated, BROKEN_REWARD, LEAST_REWARD))
