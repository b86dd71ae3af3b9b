"""Intervals count what a further effect beside the named ones would make of a parameter."""

from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym.discovery.answer.estimates import _shifts_beside
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.selection.candidate_fits import LEAST_GAIN

MASS, DRAG, FRICTION = "slide.mass_kg", "drag.coefficient", "friction.force"


def fit(chi_square, **values):
    """A fit of a mass with effects of one parameter each."""
    paths = {"mass": MASS, "drag": DRAG, "friction": FRICTION}
    names = tuple(name for name in values if name != "mass")
    model, steps = SimpleNamespace(), np.zeros(len(values))
    at = tuple(paths[name] for name in values)
    numbers = np.array(list(values.values()))
    return Fitted(model, names, at, numbers, np.eye(len(at)), chi_square, steps, True)


def diagnosed(*beside, named=("drag",)):
    """A drag is named; fits of a friction beside it, in the last round."""
    before = fit(1000.0, mass=5.0, drag=2.0)
    last = SimpleNamespace(before=before, fits=dict(enumerate(beside)))
    chosen = tuple(SimpleNamespace(name=name) for name in named)
    return SimpleNamespace(
        selection=SimpleNamespace(fit=fit(990.0, mass=5.1, drag=2.1), chosen=chosen, stages=[last])
    )


def test_a_friction_that_explains_more_moves_the_drag_and_the_mass():
    more = fit(1000.0 - LEAST_GAIN, mass=4.8, drag=1.5, friction=0.3)
    diagnosis = diagnosed(more)
    assert _shifts_beside(diagnosis, diagnosis.selection.fit, DRAG) == pytest.approx([0.0, -0.5])
    assert _shifts_beside(diagnosis, diagnosis.selection.fit, MASS) == pytest.approx([0.0, -0.2])


def test_what_explains_hardly_more_moves_nothing():
    less = fit(1001.0 - LEAST_GAIN, mass=4.8, drag=1.5, friction=0.3)
    diagnosis = diagnosed(less)
    assert _shifts_beside(diagnosis, diagnosis.selection.fit, DRAG) == [0.0]


def test_a_round_beside_other_effects_says_nothing():
    more = fit(0.0, mass=4.8, drag=1.5, friction=0.3)
    for diagnosis in (diagnosed(more, named=("spring",)), diagnosed(more, named=())):
        assert _shifts_beside(diagnosis, diagnosis.selection.fit, DRAG) == [0.0]
    diagnosis = diagnosed(more)
    assert _shifts_beside(diagnosis, fit(990.0, mass=5.1, drag=2.1), DRAG) == [0.0]
