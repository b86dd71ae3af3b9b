"""Averaged weights follow their formula, and a model gets its own back."""

import pytest

pytest.importorskip("stable_baselines3")

import torch
from torch import nn

from benchmarks.training.averaging import SPANS, WeightAverage, averaged


class Model:
    """As much of a model as an average needs: one number is all that it learns."""

    def __init__(self):
        self.policy = nn.Linear(1, 1, bias=False)
        self.num_timesteps, self._total_timesteps = 0, 1000

    @property
    def weight(self):
        return float(self.policy.weight.detach())

    def at(self, steps, weight):
        self.num_timesteps = steps
        self.policy.weight.data.fill_(weight)


def averaging(share, total=None):
    model, average = Model(), WeightAverage(share, total)
    average.model = model  # type: ignore[assignment]

    def rollout(steps, weight):
        model.at(steps, weight)
        average.on_rollout_start()
        return None if average.weights is None else float(average.weights[0])

    return model, average, rollout


def test_the_average_is_exponential_in_control_steps():
    _, _, rollout = averaging(0.2)
    assert rollout(0, 3.0) == 3.0
    assert rollout(50, 1.0) == pytest.approx(3.0 + 0.25 * (1.0 - 3.0))
    assert rollout(150, 0.0) == pytest.approx(2.5 * (1.0 - 0.5))
    # A rollout longer than the span: what is there now.
    assert rollout(800, 7.0) == 7.0


def test_it_begins_some_spans_before_the_end():
    _, average, rollout = averaging(0.1, total=2000)
    first = (1.0 - SPANS * 0.1) * 2000
    assert rollout(first - 1, 5.0) is None
    assert rollout(first, 4.0) == 4.0
    assert average.seen == first


def test_inside_the_model_has_the_average_and_outside_its_own_weights():
    model, average, rollout = averaging(0.5)
    rollout(0, 2.0)
    rollout(250, 4.0)
    with averaged(model, average):  # type: ignore[arg-type]
        assert model.weight == pytest.approx(3.0)
    assert model.weight == 4.0
    with pytest.raises(RuntimeError), averaged(model, average):  # type: ignore[arg-type]
        raise RuntimeError
    assert model.weight == 4.0 and float(average.weights[0]) == pytest.approx(3.0)


@pytest.mark.parametrize("average", [None, WeightAverage(0.1)])
def test_without_an_average_nothing_changes(average):
    model = Model()
    model.at(0, 2.0)
    with averaged(model, average):  # type: ignore[arg-type]
        assert model.weight == 2.0
    assert torch.equal(model.policy.weight.data, torch.tensor([[2.0]]))
