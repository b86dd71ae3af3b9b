"""Dry friction of the slide: sticks, breaks away, slides, remembers its way, and is odd."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pma_gym.effects.slide.coulomb_friction import friction_force, friction_path
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.plant.statics import Condition

STATIC, DYNAMIC, PRESLIDING = 1.96, 1.47, 10e-6
P = load_model("serres2008").parameters["coulomb_friction"]


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
    """Contraction, velocity, friction (N) and memory under a force (N) over time; cable far off."""
    state = np.zeros(len(plant.states))
    state[plant.states.index("pressure")] = 100e3 * force[0]
    regulator = (100.0 * force + 20.4) / 59.9
    start = Condition(state, zero_contraction=1e3)
    states, _ = plant.run(when, np.zeros_like(when), regulator, condition=start)
    names = ("contraction", "velocity", "memory_coulomb_friction")
    x, velocity, memory = (states[:, plant.states.index(name)] for name in names)
    p = plant.model.parameters["coulomb_friction"]
    return x, velocity, -friction_force(velocity, 1.0, memory, p), memory


def test_below_the_static_force_it_holds_for_a_minute():
    plant = bare(viscous=1.0)
    when = np.linspace(0.0, 60.0, 601)
    for force in (0.5, 1.2, 1.8):
        x, _, friction, _ = pushed(plant, when, np.full(601, force))
        assert friction[-1] == pytest.approx(force, rel=1e-6)
        assert abs(x[-1] - x[50]) < 1e-10
        assert 0.0 < x[-1] < 12e-6


def test_a_small_swing_of_the_load_does_not_walk_it_away():
    plant = bare(viscous=1.0)
    when = np.linspace(0.0, 60.0, 6001)
    x, *_ = pushed(plant, when, 0.9 + 0.4 * np.sin(2.0 * np.pi * when))
    assert np.abs(x[5900:6001] - x[900:1001]).max() < 1e-10
    assert np.ptp(x[5900:]) < 5e-6
    # Beyond the elastic 70 % of the static force each swing takes a little, under 1 um.
    x, *_ = pushed(plant, when, 1.5 + 0.2 * np.sin(2.0 * np.pi * when))
    assert 0.0 < x[6000] - x[1000] < 50e-6


def test_under_seven_tenths_of_the_static_force_it_is_a_spring():
    when = np.linspace(0.0, 2.0, 2001)
    force = 0.69 * STATIC * np.sin(np.pi * when)
    # Pushed by a constant, so that the pressure stays above zero.
    x, velocity, friction, _ = pushed(bare(intercept=-3.0, viscous=0.1), when, force + 3.0)
    spring = STATIC / PRESLIDING * x
    creep = np.abs(velocity).max() / 5e-3
    # But for the Stribeck share of the creeping speed, which is squared.
    np.testing.assert_allclose(friction, spring, atol=STATIC * creep**2 + 1e-12)
    assert creep < 0.01
    # Forth, back and forth again: what is left is the delay by damping over stiffness, 0.5 ms,
    # and the regulator's, 1 ms.
    assert abs(x[-1]) < 6e-3 * np.abs(x).max()


def test_it_breaks_away_at_the_static_force():
    when = np.linspace(0.0, 2.0, 2001)
    force = 1.2 * when
    x, _, friction, _ = pushed(bare(viscous=0.1), when, force)
    # The bristles give way over 1.3 presliding distances.
    gone = force[int(np.argmax(x > 1.3 * PRESLIDING))]
    assert gone == pytest.approx(STATIC, rel=0.01)
    assert friction.max() == pytest.approx(STATIC, rel=0.01)
    assert x[force < 0.99 * STATIC].max() < 1.3 * PRESLIDING
    assert x[-1] > 1e-3


def test_while_sliding_it_is_the_dynamic_force():
    # 100 mm/s against a viscous 0.01 N s/mm: 1 N of it, the rest is friction.
    plant = bare(viscous=0.01)
    when = np.linspace(0.0, 1.0, 1001)
    _, velocity, friction, _ = pushed(plant, when, np.full(1001, 2.5))
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
    x, velocity, friction, _ = pushed(plant, when, force)
    assert velocity.max() > 0.05
    # The bristle gives back its few micrometres, and that is all.
    assert x.max() - x[-1] < 12e-6
    assert abs(velocity[-1]) < 1e-3
    assert np.abs(friction).max() < STATIC * 1.001


def test_on_the_way_back_it_follows_the_laws_path():
    plant = bare(intercept=-3.0, viscous=0.05)
    when = np.linspace(0.0, 1.0, 20001)
    force = 3.0 + 2.5 * np.sin(9.0 * when) + 0.9 * np.sin(70.0 * when)
    x, velocity, _, z = pushed(plant, when, force)
    turned = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    assert len(turned) > 10
    checked = 0
    for first, last in zip(turned[:-1] + 1, turned[1:], strict=True):
        # From each turning to the next in one go, over presliding and sliding alike.
        direction = np.sign(velocity[first])
        for at in range(first, last + 1, 7):
            expected = friction_path(z[first], x[at] - x[first], direction, P)
            assert z[at] == pytest.approx(expected, abs=1e-9)
            checked += 1
    assert checked > 1000
    assert z.max() == 1.0 and z.min() == -1.0


@given(st.floats(-1, 1), st.floats(0, 30), st.floats(0, 30), st.sampled_from([-1.0, 1.0]))
def test_a_way_in_two_parts_is_the_way_in_one(memory, first, second, direction):
    travels = [direction * 1e-6 * way for way in (first, second)]
    once = friction_path(memory, travels[0] + travels[1], direction, P)
    twice = friction_path(friction_path(memory, travels[0], direction, P), travels[1], direction, P)
    assert twice == pytest.approx(once, abs=1e-7)
    assert -1.0 <= once <= 1.0


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_path_is_a_line_then_a_parabola_then_full(direction):
    def after(memory, micrometres):
        return direction * friction_path(
            direction * memory, direction * 1e-6 * micrometres, direction, P
        )

    assert after(0.0, 7.0) == pytest.approx(0.7)
    assert after(-1.0, 10.0) == pytest.approx(0.0, abs=1e-15)
    assert after(0.0, 10.0) == pytest.approx(0.7 + 0.3 - 0.075)
    assert after(0.0, 13.0) == pytest.approx(1.0) == after(0.0, 1000.0) == after(-1.0, 23.0)
    assert after(0.4, 0.0) == 0.4
    # Loaded and unloaded under 0.7, forth and back on one line.
    assert friction_path(friction_path(0.0, 5e-6, 1.0, P), -5e-6, -1.0, P) == 0.0


def test_a_long_hold_takes_hardly_more_than_an_attempt_a_row():
    # Held so long that the speed is next to nothing, 1e-321 m/s, when the load goes.
    values = {
        "contractile_force.slope_n_per_kpa": 2.9098897024054002,
        "contractile_force.intercept_n": 45.492000000353104,
        "damping.contracting_n_s_per_mm": 2.847753002007287,
        "drive.gain_n_per_v": 97.96156794589935,
    }
    plant = Plant(load_model("serres2008").replace(values))
    time = np.arange(60 * 128 + 1) / 128.0
    low, high = 1.3825440966106401, 9.5
    motor = np.interp(time, [2.0, 2.0 + 1 / 128, 47.0, 47.0 + 1 / 128], [low, high, high, low])
    regulator = np.full(len(time), 6.10016694490818)
    start = plant.settle(low, regulator_voltage=6.10016694490818)
    run = Run(time, motor, regulator, "foh", plant.table, start.state, start.zero_contraction)
    attempts = []
    # A daemon: were it to run for ever, the test would fail all the same.
    work = threading.Thread(
        target=lambda: attempts.append(simulate_all(plant.program, [run])), daemon=True
    )
    work.start()
    work.join(timeout=30.0)
    assert attempts, "it does not end"
    assert attempts[0] < 1.2 * len(time)
