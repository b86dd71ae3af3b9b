"""A policy with iterative learning: what it learns, what it receives less of, and when it begins
anew."""

import re

import numpy as np
import pytest

from controllers import PolicyWithILC
from controllers.models.nominal_motion import nominal_motion
from controllers.policy import PolicyError
from controllers.policy_with_ilc import LEAST_SHARE, EarlierTrials, Softened, smooth
from pma_gym.envs import Measurement, PMAEnv
from pma_gym.plant.model import load_model
from tests.controllers.conftest import trial

PERIOD, STEPS = 0.01, 501
READING = (1.0, 2.0, 3.0, 4.0)


def weaker():
    """The station with a drive that pulls a tenth less than controllers are told."""
    nominal = load_model("station")
    return nominal.replace({"drive.gain_n_per_v": 0.9 * nominal.parameters["drive"].gain})


def trials(controller, seeds, env):
    """RMSE (mm) of each trial in turn."""
    told = load_model("station")
    return [trial(controller, env, seed, told)["rmse_mm"] for seed in seeds]


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
    left = trials(PolicyWithILC(), range(300, 310), env)
    alone = [trials(PolicyWithILC(), [seed], env)[0] for seed in range(307, 310)]
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
    first = trials(controller, [5], env)
    assert trials(controller, [5], env) != first
    trials(controller, [5], PMAEnv("displacement", pressure_kpa=350.0))
    assert trials(controller, [5], env) == first
    trials(controller, range(20, 20 + controller.repetitions - 1), env)
    assert trials(controller, [5], env) == first


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
    trials(controller, [5], env)
    for _ in range(2):
        with pytest.raises(PolicyError, match=re.escape(message)):
            controller.reset(refused.reference, refused.station)
    assert trials(controller, [6], env) == trials(fresh, [5, 6], env)[1:]


def test_without_a_trial_there_is_nothing_to_act_on(reading):
    with pytest.raises(RuntimeError, match="ppo_ilc has no trial: call reset"):
        PolicyWithILC().act(reading(), 0.0)
