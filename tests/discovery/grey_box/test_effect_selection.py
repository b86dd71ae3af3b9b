"""Which parameters may differ by trial: those that carry the latent force, by what matters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym.discovery.grey_box import effect_selection
from pma_gym.discovery.grey_box.effect_selection import is_carried
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move
from pma_gym.estimation.innovations import TREND, TRIAL, Point
from pma_gym.estimation.likelihood_fit import BLOCKS, Coordinate, Fit


def fitted(forces, coordinate=None, value=0.0):
    """A hypothesis whose trials have latent forces (N), with a number of one trial free."""
    coordinates = (coordinate,) if coordinate else ()
    own, free = {each.name: value for each in coordinates}, len(coordinates)
    point = Point({"slide.mass": 5.0, "two_way_drive.gain": 1.0, **own}, (1e-5,), forces, 0.1)
    fit = Fit(point, 0.0, coordinates, {}, np.eye(free), np.zeros((BLOCKS, free)))
    return Hypothesis(SimpleNamespace(rows=[], order=np.array([-1.0, 0.0, 1.0])), fit)


ALONE = Coordinate(f"slide.mass{TRIAL}1", 1.0, False, 1.0, 25.0)
DRIFT = Coordinate(f"two_way_drive.gain{TREND}", 1.0)


@pytest.mark.parametrize(
    ("coordinate", "value", "after", "carried"),
    [
        (ALONE, 8.0, (0.2, 0.2, 0.2), True),
        (ALONE, 25.0, (0.2, 0.2, 0.2), False),
        # Beside what every trial lacks, one trial's own mass is more likely, and stands in for it.
        (ALONE, 8.0, (0.2, 0.2, 3.9), False),
        # A fiftieth of the mass is what a data sheet is off by.
        (ALONE, 5.09, (0.2, 0.2, 0.2), False),
        (ALONE, 5.11, (0.2, 0.2, 0.2), True),
        (DRIFT, -0.02, (0.2, 0.2, 0.2), True),
        (DRIFT, -0.009, (0.2, 0.2, 0.2), False),
        (DRIFT, -0.02, (1.9, 0.2, 3.9), False),
    ],
)
def test_what_differs_by_trial_carries_most_of_the_latent_force(coordinate, value, after, carried):
    now = fitted((2.5, 0.2, 4.4))
    assert is_carried(now, fitted(after, coordinate, value)) is carried


GAIN_OF_ONE = Coordinate(f"two_way_drive.gain{TRIAL}1", 1.0, False, 0.1, 5.0)


@pytest.mark.parametrize(("most", "said"), [(0.0, DRIFT.name), (500.0, None)])
def test_a_trend_is_tried_where_one_trial_gains_most_but_carries_too_little(
    monkeypatch, most, said
):
    fits = {
        GAIN_OF_ONE.name: (268.0, fitted((2.5, 0.2, 3.0), GAIN_OF_ONE, 0.9)),
        DRIFT.name: (533.0, fitted((0.2, 0.2, 0.2), DRIFT, -0.05)),
    }

    def tried(trials, now, move):
        gain, made = fits[move.name]
        return replace(made, fit=replace(made.fit, value=gain), moves=(move,))

    monkeypatch.setattr(effect_selection, "tried", tried)
    selection = effect_selection.EffectSelection(SimpleNamespace(channels=[0]), (), 0, print)
    selection.most = most
    now = fitted((2.5, 0.2, 4.4))
    now.box.rows.append(SimpleNamespace(there=np.ones((300, 1), bool)))
    made = selection._tried(now, Move(GAIN_OF_ONE.name, 0.0, 1, slots=(GAIN_OF_ONE.name,)))
    assert (made and made.moves[0].name) == said
