"""Muscles scaled from the tested one: the geometric law's own scaling, and identity."""

import numpy as np
import pytest

from pma_gym.effects.muscle.geometric_force import SchulteForce, schulte_force
from pma_gym.plant.exercise_device.device import (
    TESTED,
    Muscles,
    MusclesError,
    muscles,
    scaled_force,
)
from pma_gym.plant.model import load_model
from pma_gym.plant.statics import muscle_force

PRESSURE, CONTRACTION = np.meshgrid(np.linspace(150e3, 575e3, 9), np.linspace(-0.01, 0.065, 16))


@pytest.fixture(scope="module")
def force():
    return muscle_force(load_model("station"))


def test_the_tested_muscle_has_the_same_bits(force):
    of = muscles(1, 20, 250)
    assert of == TESTED and not of.extrapolated
    same = scaled_force(force, of)(PRESSURE, CONTRACTION)
    assert same.tobytes() == force(PRESSURE, CONTRACTION).tobytes()


@pytest.mark.parametrize("of", [(2, 20, 250), (1, 10, 250), (1, 20, 251)])
def test_all_others_are_extrapolated(of):
    assert muscles(*of).extrapolated


def test_forces_add_and_grow_with_the_square_of_the_diameter(force):
    one = scaled_force(force, TESTED)(PRESSURE, CONTRACTION)
    three = scaled_force(force, muscles(3, 20, 250))(PRESSURE, CONTRACTION)
    wide = scaled_force(force, muscles(1, 40, 250))(PRESSURE, CONTRACTION)
    assert three == pytest.approx(3.0 * one, rel=1e-14)
    assert wide == pytest.approx(4.0 * one, rel=1e-14)


def test_at_equal_strain_the_length_does_not_matter(force):
    long = scaled_force(force, muscles(1, 20, 500))(PRESSURE, 2.0 * CONTRACTION)
    assert long == pytest.approx(force(PRESSURE, CONTRACTION), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize(("diameter", "length"), [(0.010, 0.250), (0.040, 0.400), (0.015, 0.120)])
def test_it_is_how_the_geometric_law_scales_at_one_braid_angle(diameter, length):
    def law(d, length0):
        # tan(alpha0) = pi n D0 / L0 is the same for all.
        turns = 2.085 * (0.020 / 0.250) * length0 / d
        return lambda p, x: schulte_force(p, x, SchulteForce(1.0, length0, d, turns))

    scaled = scaled_force(law(0.020, 0.250), Muscles(1, diameter, length))
    x = CONTRACTION * length / 0.250
    assert scaled(PRESSURE, x) == pytest.approx(law(diameter, length)(PRESSURE, x), rel=1e-12)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((0, 20, 250), "muscles must be a whole number in 1 to 100, got 0; give"),
        ((1.5, 20, 250), r"muscles must be a whole number in 1 to 100, got 1\.5"),
        ((1, 0.02, 250), r"diameter must lie in 5 to 80 mm, got 0\.02; check unit"),
        ((1, 20, 0.25), r"length must lie in 40 to 2000 mm, got 0\.25; check unit"),
        ((1, float("nan"), 250), "diameter must lie in 5 to 80 mm, got nan"),
    ],
)
def test_muscles_that_cannot_be_are_refused(given, message):
    with pytest.raises(MusclesError, match=message):
        muscles(*given)
