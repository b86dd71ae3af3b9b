"""Averages a policy's weights while it is trained: what exploration leaves restless evens out."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

SPANS = 7.0
"""How many spans before the training's end the average begins, if the training is so long."""


class WeightAverage(BaseCallback):
    """An exponential moving average of the policy's weights, updated before every rollout.

    Source:
        B. T. Polyak and A. B. Juditsky 1992, "Acceleration of Stochastic Approximation by
        Averaging", SIAM Journal on Control and Optimization 30; here with exponential weights.

    Args:
        share: time constant of the average, as a share of the whole training.
        total: control steps of the whole training; those of `learn` if not given.

    Attributes:
        weights: the average of each of the policy's parameters; None before it began.
        seen: control steps at which it was updated last.
    """

    def __init__(self, share: float, total: int | None = None) -> None:
        super().__init__()
        self.share, self.total = share, total
        self.weights: list[torch.Tensor] | None = None
        self.seen = 0

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        total = self.total or int(self.model._total_timesteps)
        since, self.seen = self.model.num_timesteps - self.seen, self.model.num_timesteps
        if self.seen < (1.0 - SPANS * self.share) * total:
            return
        now = [parameter.data for parameter in self.model.policy.parameters()]
        if self.weights is None:
            self.weights = [one.clone() for one in now]
            return
        weight = min(1.0, since / (self.share * total))
        for mean, one in zip(self.weights, now, strict=True):
            mean.lerp_(one, weight)


@contextmanager
def averaged(model: BaseAlgorithm, average: WeightAverage | None) -> Iterator[None]:
    """Inside, a model has its averaged weights, if there are any."""
    if average is None or average.weights is None:
        yield
        return
    now = [parameter.data.clone() for parameter in model.policy.parameters()]
    set_weights(model, average.weights)
    try:
        yield
    finally:
        set_weights(model, now)


def set_weights(model: BaseAlgorithm, weights: list[torch.Tensor]) -> None:
    """Give each of a policy's parameters a value."""
    for parameter, one in zip(model.policy.parameters(), weights, strict=True):
        parameter.data.copy_(one)
