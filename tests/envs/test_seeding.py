"""`np_random_seed` says how to begin again; a generator set as `np_random` gives a seed."""

import numpy as np
import pytest

from pma_gym.envs import PMAEnv, PMAVectorEnv


def test_the_seed_of_an_unseeded_environment_begins_it_again(single, course, same):
    for early in (True, False):
        env = single({"randomisation": "varied", "pressure_kpa": "random"})
        seed = env.np_random_seed if early else None
        first = [env.reset(), *course(env, 60), env.reset()]
        assert env.np_random_seed == seed or not early
        other = single({"randomisation": "varied", "pressure_kpa": "random"})
        again = [other.reset(seed=env.np_random_seed), *course(other, 60), other.reset()]
        assert same(again, first)


def test_the_seed_is_the_last_one_given(single):
    env = single({})
    env.reset(seed=7)
    env.reset()
    assert env.np_random_seed == 7
    expected = np.random.Generator(np.random.PCG64(np.random.SeedSequence(7))).random(4)
    np.testing.assert_array_equal(env.np_random.random(4), expected)


def test_draws_from_np_random_change_no_episode(single, course, same):
    env, other = single({}), single({})
    env.reset(seed=7)
    other.reset(seed=7)
    env.np_random.random(100)
    assert same([*course(env, 3), env.reset()], [*course(other, 3), other.reset()])


@pytest.mark.parametrize("make", [PMAEnv, lambda: PMAVectorEnv(2)], ids=["single", "batch"])
def test_a_generator_that_is_set_gives_the_seed_of_the_next_reset(make, same):
    """As Tianshou's environments are seeded."""
    env, other = make(), make()
    for each in (env, other):
        each.reset(seed=1)
        each.np_random = np.random.default_rng(5)
    assert same(env.reset(), other.reset())
    third = make()
    third.np_random = np.random.default_rng(6)
    assert not same(third.reset()[0], env.reset()[0])
    # A seed that is given counts, and a generator only once.
    env.np_random = np.random.default_rng(7)
    env.reset(seed=3)
    assert env.np_random_seed == 3
    assert isinstance(env.np_random, np.random.Generator)
    with pytest.raises(TypeError, match="must be a numpy.random.Generator, got int"):
        env.np_random = 5


def test_seeds_of_batches():
    envs = PMAVectorEnv(3, model="serres2008", randomisation="varied")
    seed = envs.np_random_seed
    seen, _ = envs.reset()
    assert envs.np_random_seed == seed
    again = PMAVectorEnv(3, model="serres2008", randomisation="varied")
    np.testing.assert_array_equal(again.reset(seed=seed)[0], seen)
    envs.reset(seed=11)
    envs.reset()
    assert envs.np_random_seed == 11
    envs.reset(seed=[4, None, 9])
    assert envs.np_random_seed == (4, 12, 9)
    mask = np.array([False, True, False])
    envs.reset(seed=20, options={"reset_mask": mask})
    assert envs.np_random_seed == (4, 21, 9)
    with pytest.raises(AttributeError):
        envs.np_random_seed = 3


def test_some_seeds_given_and_the_others_drawn_begin_again():
    first = PMAVectorEnv(3, model="serres2008")
    seen, _ = first.reset(seed=[4, None, None])
    seeds = first.np_random_seed
    assert isinstance(seeds, tuple) and seeds[0] == 4 and seeds[1] != seeds[2]
    again, _ = PMAVectorEnv(3, model="serres2008").reset(seed=seeds)
    np.testing.assert_array_equal(again, seen)
