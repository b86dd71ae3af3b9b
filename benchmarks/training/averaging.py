"""Averages a policy's weights while it is trained: what exploration leaves restless evens out."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from stable_baselines3.common.callbacks import BaseCallback

SPANS = 7.0
"""How many spans before the training's end the average begins, if the training is so long."""


class WeightAverage(BaseCallback):
    """An exponential moving average of the policy's weights, updated before every rollout.

    Source:
        B. T. Polyak and A. B. Juditsky 1992, "Acceleration of Stochastic Approximation by
        Averaging", SIAM Journal on Control and Optimization 30; here with exponential weights.

    Args:
        share: time constant of the average, as a share of the whole training; 0 for no average.

    Attributes:
        weights: the average of each of the policy's parameters; none before it begins.
    """

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share
        self.weights: list[torch.Tensor] = []

    def _on_training_start(self) -> None:
        self._updated = self.model.num_timesteps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        now, total = self.model.num_timesteps, self.model._total_timesteps
        since, self._updated = now - self._updated, now
        if now < (1.0 - SPANS * self.share) * total:
            return
        own = self._own()
        if not self.weights:
            self.weights = [one.clone() for one in own]
        weight = min(1.0, since / (self.share * total))
        for mean, one in zip(self.weights, own, strict=True):
            mean.lerp_(one, weight)

    @contextmanager
    def applied(self) -> Iterator[None]:
        """Inside, the model has the averaged weights, if there are any."""
        own = [one.clone() for one in self._own()]
        try:
            self._set(self.weights or own)
            yield
        finally:
            self._set(own)

    def _own(self) -> list[torch.Tensor]:
        return [parameter.data for parameter in self.model.policy.parameters()]

    def _set(self, weights: list[torch.Tensor]) -> None:
        for parameter, one in zip(self._own(), weights, strict=True):
            parameter.copy_(one)
