"""Copies and pickles of environments go on with the same bits, independently of the original."""

import copy
import functools
import pickle
import subprocess
import sys
import threading

import gymnasium as gym
import numpy as np
import pytest

from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.tasks import EVERY_TASK, following, varied_station
from tests.envs.conftest import EVERYTHING, SINGLES

COPIERS = {
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}


@pytest.mark.parametrize(
    ("way", "options"),
    [*((way, EVERYTHING) for way in COPIERS), *(("pickle", other) for other in SINGLES[2:])],
    ids=lambda value: value if isinstance(value, str) else value["task"],
)
def test_a_copy_goes_on_with_the_same_bits(way, options, single, course, same):
    made, env = COPIERS[way], single(options)
    # Before the first reset.
    begun = made(env)
    assert same(begun.reset(seed=3), env.reset(seed=3))
    # In the midst of an episode, the original moved in between.
    course(env)
    other = made(env)
    before = other.trajectory()
    ahead = course(env, 7)
    np.testing.assert_array_equal(other.trajectory(), before)
    assert same(course(other, 7), ahead)
    assert other.plant.model == env.plant.model
    assert (other.plant is other.nominal_plant) == (env.plant is env.nominal_plant)
    # After an episode's end, and on through the next resets.
    while env._idle is None:
        env.step(env.action_space.high)
    ended = made(env)
    assert (ended.ended_by, ended._idle) == (env.ended_by, env._idle)
    assert same(ended.episode_summary(), env.episode_summary())
    with pytest.raises(gym.error.ResetNeeded, match="the episode ended at"):
        ended.step(ended.action_space.low)
    assert same(course(ended, 80), course(env, 80))


def test_pressures_of_each_are_copied(same):
    envs = PMAVectorEnv(3, model="serres2008", pressures_kpa=[200.0, [300.0, 400.0], "random"])
    envs.reset(seed=1)
    other = pickle.loads(pickle.dumps(envs))
    assert same(other.reset(), envs.reset())
    assert other.options == envs.options


def test_a_closed_batch_is_copied_closed():
    envs = PMAVectorEnv(40, threads=2, model="serres2008")
    envs.reset(seed=1)
    envs.close()
    assert copy.copy(envs).closed


def test_wrapped_environments_are_copied(same):
    env = gym.make("pma_gym/IsokineticRotation-v0", control_rate_hz=10.0, render_mode="rgb_array")
    env = gym.wrappers.TimeLimit(gym.wrappers.FrameStackObservation(env, 3), 40)
    env = gym.wrappers.NormalizeObservation(gym.wrappers.RecordEpisodeStatistics(env))
    env.reset(seed=1)
    for _ in range(20):
        env.step(env.action_space.sample())
    env.render()
    other = COPIERS["pickle"](env)
    assert other.spec == env.spec
    actions = [other.action_space.sample() for _ in range(15)]
    # Spaces go on with the same draws too, each with its own.
    assert same([env.action_space.sample() for _ in range(15)], actions)
    for action in actions:
        seen, its = env.step(action), other.step(action)
        assert same(seen[:4], its[:4])
    np.testing.assert_array_equal(env.render(), other.render())


def test_subclasses_keep_what_they_add(course, same):
    class Weighted(PMAEnv):
        def __init__(self, weights):
            super().__init__("displacement", model="serres2008")
            self.weights = weights

    env = Weighted([1.0, 2.0])
    env.reset(seed=1)
    other = copy.deepcopy(env)
    assert type(other) is Weighted
    assert other.weights == env.weights and other.weights is not env.weights
    assert same(course(other, 3), course(env, 3))


def test_tasks_pickle():
    for task in EVERY_TASK.values():
        assert pickle.loads(pickle.dumps(task)) == copy.deepcopy(task) == task


def heavier(nominal, generator, most=1.0):
    """A slide of up to twice the mass."""
    mass = nominal.values_in_files("slide")["mass_kg"]
    return nominal.replace({"slide.mass_kg": mass * (1.0 + most * generator.random())})


class Heavier:
    """A randomisation with numbers of its own."""

    def __init__(self):
        self.drawn = []

    def __call__(self, nominal, generator):
        self.drawn.append(generator.random())
        return heavier(nominal, generator)


@pytest.mark.parametrize(
    "randomisation",
    [
        heavier,
        functools.partial(varied_station, variation=0.5),
        lambda nominal, generator: heavier(nominal, generator, 0.5),
        Heavier(),
    ],
    ids=["function", "partial", "lambda", "object"],
)
def test_own_randomisations_are_copied(randomisation, course, same):
    env = gym.make("pma_gym/IsokineticDisplacement-v0", randomisation=randomisation)
    env.reset(seed=2)
    other = COPIERS["pickle"](env)
    assert same(course(other, 3), course(env, 3))
    assert same(other.reset(), env.reset())
    assert other.unwrapped.plant.model == env.unwrapped.plant.model


def test_own_tasks_are_copied(course, same):
    task = following("bow", "extension", lambda time: 0.8e-3 * time * (10.0 - time))
    env = PMAEnv(task, model="serres2008", pressure_kpa=300.0)
    env.reset(seed=2)
    other = COPIERS["pickle"](env)
    assert same(course(other, 5), course(env, 5))
    assert other.reference(3.0) == env.reference(3.0) == pytest.approx(16.8e-3)


class Locked:
    """A randomisation, or a motion, that holds what no pickle takes."""

    def __init__(self):
        self.lock = threading.Lock()

    def __call__(self, *given):
        return given[0] * 1e-3 if len(given) == 1 else given[0]


def test_what_cannot_be_pickled_is_named_with_the_fix():
    env = gym.make("pma_gym/IsokineticDisplacement-v0", randomisation=Locked())
    with pytest.raises(pickle.PicklingError, match=r"^randomisation cannot be pickled, got .*lock"):
        pickle.dumps(env)
    env = PMAEnv(following("slow", "extension", Locked()))
    with pytest.raises(pickle.PicklingError, match=r"the motion of slow cannot.*; give a function"):
        pickle.dumps(env)


ELSEWHERE = """
import pickle, sys
import numpy as np
env = pickle.loads(sys.stdin.buffer.read())
seen = [env.step(np.full(1, 0.1 * k)) for k in range(5)] + [env.reset()]
sys.stdout.buffer.write(pickle.dumps(seen))
"""


def test_another_process_goes_on_with_the_same_bits(same):
    env = PMAEnv("displacement", randomisation=lambda nominal, generator: nominal)
    env.reset(seed=1)
    env.step([0.3])
    process = subprocess.run(
        [sys.executable, "-c", ELSEWHERE], input=pickle.dumps(env), capture_output=True, check=True
    )
    seen = [env.step(np.full(1, 0.1 * k)) for k in range(5)] + [env.reset()]
    assert same(pickle.loads(process.stdout), seen)
