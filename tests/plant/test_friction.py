"""Dry friction of the slide: sticks, breaks away, slides, and is odd."""

import numpy as np
import pytest

from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Condition, Plant

STATIC, DYNAMIC = 1.96, 1.47


def bare(intercept=0.0, viscous=0.001):
    """A mass on the slide, pushed by 0.01 N/kPa and a constant; no spring, no cable."""
    nothing = {
        "contractile_force.slope_n_per_kpa": 0.01,
        "contractile_force.intercept_n": intercept,
        "stiffness.low_intercept_n_per_mm": 0.0,
        "stiffness.low_slope_n_per_mm_per_kpa": 0.0,
        "stiffness.high_intercept_n_per_mm": 0.0,
        "stiffness.high_slope_n_per_mm_per_kpa": 0.0,
        "damping.contracting_n_s_per_mm": viscous,
        "damping.relaxing_n_s_per_mm": viscous,
        "damping.high_intercept_n_s_per_mm": viscous,
        "damping.high_slope_n_s_per_mm_per_kpa": 0.0,
        "regulator_lag.time_constant_s": 0.001,
    }
    return Plant(load_model("serres2008").replace(nothing))


def pushed(plant, when, force):
    """Contraction, velocity and friction under a force (N) over time, from rest; cable far off."""
    state = np.zeros(len(plant.states))
    state[plant.states.index("pressure")] = 100e3 * force[0]
    regulator = (100.0 * force + 20.4) / 59.9
    start = Condition(state, zero_contraction=1e3)
    states, _ = plant.run(when, np.zeros_like(when), regulator, condition=start)
    names = ("contraction", "velocity", "memory_coulomb_friction")
    return [states[:, plant.states.index(name)] for name in names]


def test_below_the_static_force_it_holds_for_a_minute():
    plant = bare(viscous=1.0)
    when = np.linspace(0.0, 60.0, 601)
    for force in (0.5, 1.2, 1.8):
        x, _, friction = pushed(plant, when, np.full(601, force))
        assert friction[-1] == pytest.approx(force, rel=1e-6)
        assert abs(x[-1] - x[50]) < 1e-10
        assert 0.0 < x[-1] < 12e-6


def test_a_small_swing_of_the_load_does_not_walk_it_away():
    plant = bare(viscous=1.0)
    when = np.linspace(0.0, 60.0, 6001)
    x, _, _ = pushed(plant, when, 0.9 + 0.4 * np.sin(2.0 * np.pi * when))
    assert np.abs(x[5900:6001] - x[900:1001]).max() < 1e-10
    assert np.ptp(x[5900:]) < 5e-6
    # Beyond the elastic 70 % of the static force each swing takes a little, under 1 um.
    x, _, _ = pushed(plant, when, 1.5 + 0.2 * np.sin(2.0 * np.pi * when))
    assert 0.0 < x[6000] - x[1000] < 50e-6


def test_it_breaks_away_at_the_static_force():
    when = np.linspace(0.0, 2.0, 2001)
    force = 1.2 * when
    x, _, friction = pushed(bare(viscous=0.1), when, force)
    gone = force[int(np.argmax(x > 30e-6))]
    assert gone == pytest.approx(STATIC, rel=0.02)
    assert friction.max() == pytest.approx(STATIC, rel=0.01)


def test_while_sliding_it_is_the_dynamic_force():
    # 100 mm/s against a viscous 0.01 N s/mm: 1 N of it, the rest is friction.
    plant = bare(viscous=0.01)
    when = np.linspace(0.0, 1.0, 1001)
    _, velocity, friction = pushed(plant, when, np.full(1001, 2.5))
    speed = velocity[-1]
    level = DYNAMIC + (STATIC - DYNAMIC) / (1.0 + (speed / 5e-3) ** 2)
    assert speed == pytest.approx((2.5 - level) / 10.0, rel=1e-3)
    assert friction[-1] == pytest.approx(level, rel=1e-4)
    assert friction[-1] == pytest.approx(DYNAMIC, rel=5e-3)


def test_it_is_odd():
    when = np.linspace(0.0, 0.3, 301)
    forth, back = bare(2.5), bare(-2.5)
    nothing = np.zeros(301)
    for one, other in zip(pushed(forth, when, nothing), pushed(back, when, nothing), strict=True):
        np.testing.assert_array_equal(one, -other)


def test_it_stops_what_slides_without_pushing_it_back():
    plant = bare()
    when = np.linspace(0.0, 2.0, 2001)
    force = np.where(when < 0.1, 2.5, 0.0)
    x, velocity, friction = pushed(plant, when, force)
    assert velocity.max() > 0.05
    # The bristle gives back its few micrometres, and that is all.
    assert x.max() - x[-1] < 12e-6
    assert abs(velocity[-1]) < 1e-3
    assert np.abs(friction).max() < STATIC * 1.001
