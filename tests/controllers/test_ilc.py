"""Iterative learning: its inverse, its filter, its gains, and the noise floor that it reaches.

A policy with iterative learning: what it learns, what it receives less of, and when it begins
anew.
"""

import re

import numpy as np
import pytest

from controllers import ILC, PolicyWithILC
from controllers.ilc import LearningGain, LiftedModel, Settings
from controllers.models.nominal_motion import nominal_motion
from controllers.policy import PolicyError
from controllers.policy_with_ilc import LEAST_SHARE, EarlierTrials, Softened, smooth
from pma_gym.envs import Measurement, PMAEnv
from pma_gym.plant.model import load_model
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
    """As well as the same controller that receives the true model, within a fifth."""
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


STEPS = 501
READING = (1.0, 2.0, 3.0, 4.0)


def weaker():
    """The station with a drive that pulls a tenth less than the model that controllers receive."""
    nominal = load_model("station")
    return nominal.replace({"drive.gain_n_per_v": 0.9 * nominal.parameters["drive"].gain})


def rmse_by_trial(controller, seeds, env):
    """RMSE (mm) of each trial in turn."""
    nominal = load_model("station")
    return [trial(controller, env, seed, nominal)["rmse_mm"] for seed in seeds]


def test_half_is_learned_at_the_corner_without_phase():
    wave = 0.3 * np.arange(600)
    got = smooth(np.sin(wave), np.ones(600, bool), 0.3)[200:400]
    inner = wave[200:400]
    assert 2.0 * np.mean(got * np.sin(inner)) == pytest.approx(0.5, abs=0.03)
    assert 2.0 * np.mean(got * np.cos(inner)) == pytest.approx(0.0, abs=0.02)


def test_a_line_is_drawn_through_steps_that_say_nothing():
    line, taut = np.linspace(0.0, 1.0, 200), np.ones(200, bool)
    taut[90:110] = False
    given = np.where(taut, line, 50.0)
    assert smooth(given, taut, 0.5) == pytest.approx(line, abs=0.04)


def test_learning_trials_help_on_a_station_that_the_model_does_not_know():
    env = PMAEnv("displacement", pressure_kpa=400.0, model=weaker())
    left = rmse_by_trial(PolicyWithILC(), range(300, 310), env)
    alone = [rmse_by_trial(PolicyWithILC(), [seed], env)[0] for seed in range(307, 310)]
    assert np.mean(left[-3:]) < 0.85 * np.mean(alone)


def scattered(motion, scatter, generator, moved=0.0):
    """A memory of 200 trials whose position readings differ by a standard deviation (m)."""
    earlier, moves = EarlierTrials(STEPS), np.full(STEPS + 1, moved)
    for _ in range(201):
        said = np.tile(READING, (STEPS, 1))
        said[:, 0] += scatter * generator.standard_normal(STEPS)
        earlier.add([_reading(row) for row in said], moves)
    return earlier.softened(np.zeros(STEPS + 1), motion)


def _reading(row):
    return Measurement(0.0, *row)


@pytest.fixture
def motion(station):
    return nominal_motion(lambda time: 5e-3 * time, station())


def test_what_is_not_noise_is_told(motion):
    generator = np.random.default_rng(1)
    softened = scattered(motion, 2.0 * motion.noise, generator)
    assert softened.share == pytest.approx(0.75, abs=0.01)
    assert scattered(motion, motion.noise, generator).share == LEAST_SHARE
    assert scattered(motion, 30.0 * motion.noise, generator).share > 0.998


def test_a_reading_is_moved_to_what_is_expected_by_a_share():
    softened = Softened([[1.0, 2.0, 3.0, 4.0]], 0.5)
    assert softened.reading(_reading((3.0, 2.0, 1.0, 8.0)), 0)[1:] == (2.0, 2.0, 2.0, 6.0)
    assert softened.reading(_reading((3.0, 2.0, 1.0, 8.0)), 1)[1:] == (3.0, 2.0, 1.0, 8.0)


def test_expected_positions_follow_the_reference_as_it_has_been_moved_since(motion):
    softened = scattered(motion, motion.noise, np.random.default_rng(1), moved=2e-4)
    means = np.array(softened.means)
    assert means[100:, 0] == pytest.approx(READING[0] - 2e-4, abs=1e-5)
    assert means[:, 1:] == pytest.approx(np.tile(READING[1:], (STEPS, 1)))


def test_trials_that_broke_off_are_no_measure():
    earlier = EarlierTrials(STEPS)
    for count in (STEPS, STEPS - 1, STEPS - 1, STEPS):
        earlier.add([_reading(READING)] * count, np.zeros(STEPS + 1))
    assert earlier.softened(np.zeros(STEPS + 1), None) is None


def test_learning_begins_anew_elsewhere_and_after_its_repetitions():
    """The first trial of all is met again to the last bit."""
    controller = PolicyWithILC()
    env = PMAEnv("displacement", pressure_kpa=300.0, model=weaker())
    first = rmse_by_trial(controller, [5], env)
    assert rmse_by_trial(controller, [5], env) != first
    rmse_by_trial(controller, [5], PMAEnv("displacement", pressure_kpa=350.0))
    assert rmse_by_trial(controller, [5], env) == first
    rmse_by_trial(controller, range(20, 20 + controller.repetitions - 1), env)
    assert rmse_by_trial(controller, [5], env) == first


@pytest.mark.parametrize(
    "task, options, message",
    [
        ("displacement", {"control_rate_hz": 62.5}, "no policy displacement-62.5hz-ppo is shipped"),
        (
            "isokinetic_exercise",
            {},
            "ppo_ilc learns displacement and rotation, the task's kind is isokinetic; take a "
            "policy that needs no learning trials, such as ppo",
        ),
    ],
)
def test_what_it_cannot_do_is_refused_and_changes_nothing(task, options, message):
    controller, fresh = PolicyWithILC(), PolicyWithILC()
    refused = PMAEnv(task, pressure_kpa=400.0, **options)
    refused.reset(seed=1)
    env = PMAEnv("displacement", pressure_kpa=300.0, model=weaker())
    rmse_by_trial(controller, [5], env)
    for _ in range(2):
        with pytest.raises(PolicyError, match=re.escape(message)):
            controller.reset(refused.reference, refused.station)
    assert rmse_by_trial(controller, [6], env) == rmse_by_trial(fresh, [5, 6], env)[1:]


def test_without_a_trial_there_is_nothing_to_act_on(reading):
    with pytest.raises(RuntimeError, match="ppo_ilc has no trial: call reset"):
        PolicyWithILC().act(reading(), 0.0)
