"""The reward as policies learn from it: bounded below."""

from typing import Any

import numpy as np

LEAST_REWARD, BROKEN_REWARD = -10.0, -100.0
"""Least reward of a step that is learned from, and of one that breaks a limit.

Further from the reference than 10 % of the range, and after a limit, one is as bad as another. In
full, the first episodes' rewards (down to -150 000) would drown everything else: some trainings
then learn to stay at 0 V and never leave it.
"""


def bounded(rewards: Any, terminated: Any) -> Any:  # noqa: ANN401
    """Rewards as they are learned from; of numbers or arrays.

    Args:
        rewards: of the environment.
        terminated: whether a limit broke.
    """
    return np.maximum(rewards, np.where(terminated, BROKEN_REWARD, LEAST_REWARD))
