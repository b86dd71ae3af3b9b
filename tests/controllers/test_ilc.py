"""Iterative learning: its inverse, its filter, its gains, and the noise floor that it reaches."""

import numpy as np
import pytest

from controllers import ILC, PolicyWithILC
from controllers.ilc import LearningGain, LiftedModel, Settings
from controllers.models.nominal_motion import nominal_motion
from pma_gym.envs import PMAEnv
from tests.controllers.conftest import trial

PERIOD = 0.01


@pytest.fixture
def plant(station):
    """The lifted plant of a displacement trial, from its second half on."""
    motion = nominal_motion(lambda time: 5e-3 * time, station())
    return LiftedModel(motion, 100, 400)


def bump(at, width=40.0, count=400):
    return np.exp(-0.5 * ((np.arange(count) - at) / width) ** 2)


def test_lifted_plant_is_the_local_model_step_by_step(station):
    motion = nominal_motion(lambda time: 5e-3 * time, station())
    plant = LiftedModel(motion, 0, 60)
    impulse = np.zeros(60)
    impulse[20] = 1.0
    model = motion.local(motion.expected(21 * PERIOD))
    x, known = np.zeros(len(model.b)), []
    for k in range(39):
        x = model.a @ x + (model.b if k == 0 else 0.0)
        known.append(float(model.c @ x))
    got = plant.response(impulse)
    assert got[:21] == pytest.approx(0.0, abs=1e-15)
    # The model changes on the way, by a few parts in a thousand.
    assert got[21:] == pytest.approx(known, rel=0.02, abs=2e-5)


def test_slow_errors_are_inverted_and_fast_ones_are_not_learned(plant):
    taut = np.ones(400, bool)
    slow = bump(200)
    got = plant.change(plant.response(slow), taut, cutoff=5.0)
    assert got == pytest.approx(slow, abs=0.02)
    fast = np.sin(2.0 * np.pi * 25.0 * PERIOD * np.arange(400))
    got = plant.change(plant.response(fast), taut, cutoff=5.0)
    assert np.abs(got[50:350]).max() < 0.02


def test_half_is_learned_at_the_cutoff_without_phase(plant):
    wave = 2.0 * np.pi * 4.0 * PERIOD * np.arange(400)
    got = plant.change(plant.response(np.sin(wave)), np.ones(400, bool), cutoff=4.0)[100:300]
    inner = wave[100:300]
    assert 2.0 * np.mean(got * np.sin(inner)) == pytest.approx(0.5, abs=0.05)
    assert 2.0 * np.mean(got * np.cos(inner)) == pytest.approx(0.0, abs=0.02)


def test_next_to_nothing_is_changed_where_the_cable_is_slack(plant):
    taut = np.ones(400, bool)
    taut[:60] = False
    error = plant.response(np.ones(400))
    got = plant.change(error, taut, cutoff=5.0)
    # Just before it comes tight a voltage still counts for what follows.
    assert np.abs(got[:40]).max() < 0.0125
    assert np.abs(got[:60]).max() < 0.4
    assert got[80:300] == pytest.approx(1.0, abs=0.05)


def test_with_a_perfect_model_gains_are_those_of_the_mean():
    gain = LearningGain(0.0)
    powers = [1e9, *[1.0 + 1.0 / (j + 1) for j in range(9)]]
    got = [gain.next(power) for power in powers]
    assert got == pytest.approx([1.0 / (j + 1) for j in range(10)], rel=1e-6)


def test_a_doubtful_model_goes_on_learning_first():
    sure, doubtful = (LearningGain(m) for m in (0.1, 0.5))
    gains = np.array([[g.next(1e4), g.next(1e3), g.next(1e2)] for g in (sure, doubtful)])
    assert gains[0, 0] > gains[1, 0] > 0.75
    assert gains[1, 2] > gains[0, 2]


def test_what_comes_and_goes_is_averaged():
    """Trials that each leave as much as the first are noise: soon little is learned of one."""
    gain = LearningGain(0.3)
    got = [gain.next(1e4) for _ in range(9)]
    assert got[0] > 0.9
    assert got[-1] < 0.2


def trials(env, nominal=None, count=10):
    """RMSE (mm) by trial, each with noise of its own."""
    controller = ILC(Settings(3.0, 0.3, 0.3))
    return [trial(controller, env, 50 + k, nominal)["rmse_mm"] for k in range(count)]


def drawn(task, pressure_kpa, seed, **loop):
    """A station of another force and damping, and the nominal model."""
    env = PMAEnv(task, pressure_kpa=float(pressure_kpa), randomisation="varied")
    env.reset(seed=seed)
    return PMAEnv(
        task, model=env.plant.model, pressure_kpa=float(pressure_kpa), **loop
    ), env.station.model


@pytest.mark.parametrize("loop", [{}, {"control_rate_hz": 50.0, "action_delay_s": 0.02}])
def test_noise_floor_is_reached_in_ten_trials(loop):
    """As well as the same controller that was told the true model, within a fifth."""
    env, nominal = drawn("displacement", 150, seed=300, **loop)
    learned = trials(env, nominal)
    errors = trials(env)
    assert learned[0] > 2.0 * errors[0]
    assert np.mean(learned[-3:]) < 1.2 * np.mean(errors[-3:])
    # Nor does repeating make the noise grow.
    assert np.mean(learned[-3:]) < 1.2 * np.mean(errors[:3])


def test_contraction_by_the_regulator_is_learned():
    env, nominal = drawn("isotonic", 200, seed=301)
    left = trials(env, nominal, count=4)
    assert left[-1] < 0.5 * left[0]


def test_another_station_and_the_eleventh_trial_begin_anew(station, reading):
    controller = ILC(Settings(3.0, 0.3, 0.3))

    def practise(given):
        controller.reset(lambda time: 5e-3 * time, given)
        for k in range(501):
            controller.act(reading(extension=5e-3 * k * PERIOD - 1e-3), k * PERIOD)

    given = station()
    practise(given)
    practise(given)
    assert np.abs(controller.learned).max() > 0.05
    practise(station(pressure_kpa=400.0))
    assert not controller.learned.any()
    for _ in range(controller.repetitions):
        practise(given)
        changed = controller.learned.any()
    assert changed
    practise(given)
    assert not controller.learned.any()


@pytest.mark.parametrize(
    ("make", "kept"),
    [(lambda: ILC(Settings(3.0, 0.3, 0.3)), "learned"), (PolicyWithILC, "moved")],
    ids=["ilc", "ppo_ilc"],
)
def test_a_trial_that_broke_off_is_learned_from_as_far_as_it_came(make, kept, station, reading):
    controller = make()
    for steps in (100, 0, 0):
        controller.reset(lambda time: 5e-3 * time, station())
        for k in range(steps):
            controller.act(reading(extension=5e-3 * k * PERIOD - 1e-3), k * PERIOD)
        learned = getattr(controller, kept)
        assert learned[:100].any() == (steps == 0) and not learned[100:].any()
