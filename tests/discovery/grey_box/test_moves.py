"""What is worth a fit though little promises it."""

from types import SimpleNamespace

from pma_gym.discovery.grey_box.hypothesis import Move
from pma_gym.discovery.grey_box.moves import _beside


def move(name):
    """A parameter that differs by trial, or a clock."""
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


def test_a_clock_is_always_fitted_for_a_latent_force_hides_its_slope():
    assert names(EVEN, "slide.mass~", "slide.mass@2", "clock") == ["clock"]
