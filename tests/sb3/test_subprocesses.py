"""Stable-Baselines3's SubprocVecEnv hands environments and what they hold over from its workers."""

import copy
import pickle

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.vec_env import SubprocVecEnv

from pma_gym.envs import PMAEnv
from pma_gym.plant.plant import Plant
from pma_gym.sb3 import SB3VecEnv


def make() -> PMAEnv:
    """What the workers step."""
    return PMAEnv("displacement", model="serres2008", randomisation="varied", pressure_kpa=300.0)


@pytest.mark.parametrize(
    "start_method", [pytest.param("forkserver", marks=pytest.mark.campaign), "spawn"]
)
def test_get_attr_of_what_workers_hold(start_method):
    envs = SubprocVecEnv([make, make], start_method=start_method)
    try:
        envs.seed(3)
        envs.reset()
        envs.step(np.full((2, 1), 0.2, np.float32))
        copies = envs.get_attr("unwrapped")
        plants = envs.get_attr("plant")
        assert [type(env) for env in copies] == [PMAEnv, PMAEnv]
        assert all(isinstance(plant, Plant) for plant in plants)
        assert [env.plant.model for env in copies] == [plant.model for plant in plants]
        assert [env.station for env in copies] == envs.get_attr("station")
        for name in ("measurement", "task", "options", "table", "condition", "nominal_plant"):
            assert len(envs.get_attr(name)) == 2
        # The copies go on as those in the workers do.
        action = np.full((2, 1), -0.3, np.float32)
        observations, rewards, *_ = envs.step(action)
        for i, env in enumerate(copies):
            observation, reward, *_ = env.step(action[i])
            np.testing.assert_array_equal(observation, observations[i])
            assert reward == rewards[i]
        # States go there and come back.
        state = copies[0].get_state()
        envs.env_method("set_state", state, indices=[1])
        assert envs.env_method("get_state") == [state, state]
    finally:
        envs.close()


@pytest.mark.parametrize("made", [copy.deepcopy, lambda envs: pickle.loads(pickle.dumps(envs))])
def test_copies_of_a_vec_env_go_on_with_the_same_bits(made):
    envs = SB3VecEnv(3, "displacement", model="serres2008", control_rate_hz=10.0)
    envs.seed(1)
    envs.reset()
    actions = np.random.default_rng(1).uniform(-1.0, 0.0, (70, 3, 1))
    for action in actions[:45]:
        envs.step(action)
    other = made(envs)
    for action in actions[45:]:
        seen, its = envs.step(action), other.step(action)
        for one, two in zip(seen[:3], its[:3], strict=True):
            np.testing.assert_array_equal(one, two)
        returns = [[info.get("episode", {}).get(key) for info in seen[3]] for key in "rl"]
        assert returns == [[info.get("episode", {}).get(key) for info in its[3]] for key in "rl"]
