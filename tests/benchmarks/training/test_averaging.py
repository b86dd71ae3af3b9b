"""Averaged weights follow their formula, and a model gets its own back."""

import pytest

pytest.importorskip("stable_baselines3")

from torch import nn

from benchmarks.training.run import SPANS, WeightAverage


class Model:
    """As much of a model as an average needs: one number is all that it learns."""

    def __init__(self, total):
        self.policy = nn.Linear(1, 1, bias=False)
        self.num_timesteps, self._total_timesteps = 0, total

    @property
    def weight(self):
        return float(self.policy.weight.detach())


def averaging(share, total):
    model, average = Model(total), WeightAverage(share)
    average.model = model  # type: ignore[assignment]
    average.on_training_start({}, {})

    def rollout(steps, weight):
        model.num_timesteps = steps
        model.policy.weight.data.fill_(weight)
        average.on_rollout_start()
        return float(average.weights[0]) if average.weights else None

    return model, average, rollout


def test_the_average_is_exponential_in_control_steps():
    _, _, rollout = averaging(0.2, 1000)
    assert rollout(0, 3.0) == 3.0
    assert rollout(50, 1.0) == pytest.approx(3.0 + 0.25 * (1.0 - 3.0))
    assert rollout(150, 0.0) == pytest.approx(2.5 * (1.0 - 0.5))
    # A rollout longer than the span: what is there now.
    assert rollout(800, 7.0) == 7.0


def test_it_begins_some_spans_before_the_end_and_without_a_share_never():
    _, _, rollout = averaging(0.1, 2000)
    first = (1.0 - SPANS * 0.1) * 2000
    assert rollout(first - 1, 5.0) is None
    assert rollout(first, 4.0) == 4.0
    assert averaging(0.0, 2000)[2](1999, 1.0) is None


@pytest.mark.parametrize(("share", "inside"), [(0.5, 3.0), (0.0, 4.0)])
def test_inside_the_model_has_the_average_and_outside_its_own_weights(share, inside):
    model, average, rollout = averaging(share, 1000)
    rollout(0, 2.0)
    rollout(250, 4.0)
    with pytest.raises(RuntimeError), average.applied():
        assert model.weight == pytest.approx(inside)
        raise RuntimeError
    assert model.weight == 4.0
