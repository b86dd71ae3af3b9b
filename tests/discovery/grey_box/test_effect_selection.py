"""Which parameters may differ by trial: those that carry the latent force, by what matters."""

from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym.discovery.grey_box.effect_selection import is_carried
from pma_gym.discovery.grey_box.hypothesis import Hypothesis
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
