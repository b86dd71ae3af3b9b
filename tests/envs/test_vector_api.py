"""Batches as Gymnasium knows them: ids, modes, spaces, seeds, statistics."""

import inspect

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from pma_gym.envs import ENVIRONMENTS, PMAEnv, PMAVectorEnv

MADE = {"model": "serres2008", "pressure_kpa": 300, "control_rate_hz": 10.0}
NAME = "pma_gym/IsokineticDisplacement-v0"


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_ids_make_batches(name):
    # An exercise's operator must be played often enough.
    made = MADE | {"control_rate_hz": 50.0} if "Exercise" in name else MADE
    envs = gym.make_vec(name, 5, threads=2, **made)
    assert type(envs) is PMAVectorEnv
    assert envs.num_envs == 5 and envs.task.name == ENVIRONMENTS[name]
    assert envs.spec is not None and envs.spec.id == name
    observations, info = envs.reset(seed=3)
    assert envs.observation_space.contains(observations) and info == {}
    again = gym.make_vec(envs.spec)
    assert type(again) is PMAVectorEnv and again.num_envs == 5
    np.testing.assert_array_equal(again.reset(seed=3)[0], observations)
    envs.close()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_metadata_says_how_episodes_follow_each_other(batch, mode):
    for given in (mode, mode.value):
        assert batch(autoreset_mode=given).metadata["autoreset_mode"] == mode
    assert batch().metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert batch().metadata["render_fps"] == 10
    assert PMAVectorEnv.metadata["render_fps"] == 100


def test_spaces_are_those_of_the_environment_in_rows(batch):
    options = {"preview": 2, "history": 1, "regulator_action": True}
    envs, env = batch(4, **options), PMAEnv(**(MADE | options))
    assert envs.single_observation_space == env.observation_space
    assert envs.single_action_space == env.action_space
    assert envs.observation_space.shape == (4, 11) and envs.action_space.shape == (4, 2)
    envs.reset(seed=0)
    observations, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
    assert envs.observation_space.contains(observations)
    assert rewards.shape == terminated.shape == truncated.shape == (4,)
    assert (rewards.dtype, terminated.dtype, truncated.dtype) == (np.float64, bool, bool)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_gymnasiums_statistics_count_episodes(batch, mode):
    envs = RecordEpisodeStatistics(batch(4, autoreset_mode=mode))
    # Older Gymnasium leaves the first step out of episodes that a same-step reset begins.
    knows = "SAME_STEP" in inspect.getsource(RecordEpisodeStatistics.step)
    least = 51 if mode == "NextStep" or knows else 50
    envs.reset(seed=0)
    for _ in range(160):
        *_, truncated, info = envs.step(np.full((4, 1), -0.9))
        if truncated.any():
            known = info if mode == "NextStep" else info["final_info"]
            assert np.all(known["rmse_mm"] > 0.0)
            assert np.isin(info["episode"]["l"], (least, 51)).all()
            assert np.all(info["episode"]["r"] < 0.0)
    assert envs.episode_count == 12


def test_without_a_seed_environments_and_episodes_differ(batch):
    def measured_by(envs):
        """What the sensors say in an episode's first steps, shape (8, 4, 40)."""
        first, _ = envs.reset()
        later = [envs.step(np.full((8, 1), -1.0))[0] for _ in range(39)]
        return np.stack([first, *later], axis=2)[:, :4]

    # Readings are coarse, and one of two environments may well be alike.
    envs = batch(8)
    first = measured_by(envs)
    assert len(np.unique(first.reshape(8, -1), axis=0)) == 8
    for other in (measured_by(envs), measured_by(batch(8))):
        assert all(np.any(one != another) for one, another in zip(first, other, strict=True))


def test_what_is_returned_stays_as_it_was(batch):
    envs = batch()
    kept = [envs.reset(seed=0)[0]]
    copies = [kept[0].copy()]
    for _ in range(60):
        results = envs.step(np.full((3, 1), -0.5))[:4]
        kept += results
        copies += [array.copy() for array in results]
    for array, copy in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(array, copy)
