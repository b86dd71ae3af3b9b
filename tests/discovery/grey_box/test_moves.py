"""What is worth a fit though little promises it."""

from types import SimpleNamespace

import numpy as np

from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move
from pma_gym.discovery.grey_box.moves import Screening, _beside
from pma_gym.estimation.innovations import Point


def move(name):
    """A parameter that differs by trial."""
    return Move(name, 0.0, 1, slots=(name,))


def names(forces, *moves, first=1):
    """Those behind the first that are fitted too, beside latent forces of three trials."""
    now = SimpleNamespace(fit=SimpleNamespace(point=SimpleNamespace(forces=forces)))
    return [each.name for each in _beside(now, [move(name) for name in moves], first)]


EVEN = 1.0, 1.1, 0.9


def test_a_gain_that_falls_is_fitted_where_a_friction_that_rises_promises_most():
    moves = "coulomb_friction.static~", "slide.mass@1", "two_way_drive.gain~", "slide.mass~"
    assert names(EVEN, *moves) == ["two_way_drive.gain~", "slide.mass~"]


def test_all_that_one_trial_may_have_alone_is_fitted_where_one_thing_promises_most():
    moves = "coulomb_friction.static@1", "slide.mass@1", "slide.mass@2", "slide.mass~"
    assert names(EVEN, *moves) == ["slide.mass@1"]


def test_the_trial_whose_latent_force_stands_out_has_each_of_its_parameters_fitted():
    moves = "slide.mass~", "slide.mass@2", "two_way_drive.gain@2", "slide.mass@0"
    assert names((1.0, 1.1, 9.0), *moves) == ["slide.mass@2", "two_way_drive.gain@2"]


class Filter:
    """Innovations of 200 readings that an error of the clock makes larger."""

    def __init__(self, true):
        self.true, self.rows = true, [SimpleNamespace(there=np.ones((200, 1), bool))]

    def innovations(self, points):
        off = np.array([1.0 + abs(each.clock - self.true) / 1e-3 for each in points])
        errors = off[:, None, None] * np.ones((1, 200, 1))
        return [(errors, np.ones_like(errors))]


def clocks(true):
    """Moves of the clock where readings run fast by a share."""
    point = Point({}, (1.0,), (5.0,), 0.1)
    fit = SimpleNamespace(point=point, coordinates=(), tied={})
    trials = SimpleNamespace(force=1.0, noise=[1.0], memory=(0.1, 1.0))
    now = Hypothesis(Filter(true), fit)
    return Screening(trials, (), SimpleNamespace(fit=fit), print)._clocks(now)


def test_a_clock_that_runs_fast_is_fitted_from_there_beside_little_latent_force():
    for move_ in (made := clocks(0.002)):
        assert move_.start.clock == 0.002
        assert move_.is_nuisance and move_.promise > 100.0
    assert [each.start.forces for each in made] == [(0.02 * 5.0,), (0.1,)]


def test_a_clock_that_no_error_makes_likelier_is_not_fitted():
    assert clocks(0.0) == []
