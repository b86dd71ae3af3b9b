"""Stable-Baselines3's SubprocVecEnv hands environments and what they hold over from its workers."""

import pickle

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.plant.plant import Plant
from pma_gym.sb3 import SB3VecEnv


def test_get_attr_of_what_a_fresh_worker_holds():
    options = {"model": "serres2008", "randomisation": "varied", "control_rate_hz": 10.0}
    # The worker has not imported pma_gym before it makes the environment.
    envs = make_vec_env(
        f"pma_gym:{next(iter(ENVIRONMENTS))}",
        1,
        env_kwargs=options,
        vec_env_cls=SubprocVecEnv,
        vec_env_kwargs={"start_method": "spawn"},
        monitor_kwargs={"info_keywords": ("rmse_mm",)},
    )
    try:
        envs.seed(3)
        np.testing.assert_array_equal(envs.reset()[0], PMAEnv(**options).reset(seed=3)[0])
        envs.step(np.full((1, 1), 0.2, np.float32))
        copies = envs.get_attr("unwrapped")
        plants = envs.get_attr("plant")
        assert [type(env) for env in copies] == [PMAEnv]
        assert all(isinstance(plant, Plant) for plant in plants)
        assert [env.plant.model for env in copies] == [plant.model for plant in plants]
        assert [env.station for env in copies] == envs.get_attr("station")
        for name in ("measurement", "task", "options", "table", "condition", "nominal_plant"):
            assert len(envs.get_attr(name)) == 1
        # The copies go on as those in the workers do.
        action = np.full((1, 1), -0.3, np.float32)
        observations, rewards, *_ = envs.step(action)
        for i, env in enumerate(copies):
            observation, reward, *_ = env.step(action[i])
            np.testing.assert_array_equal(observation, observations[i])
            assert reward == rewards[i]
        # States go there and come back.
        state = copies[0].get_state()
        envs.step(action)
        envs.env_method("set_state", state)
        assert envs.env_method("get_state") == [state]
        for _ in range(49):
            _, _, over, infos = envs.step(np.full((1, 1), -1.0, np.float32))
        assert over.all() and infos[0]["episode"]["rmse_mm"] > 0.0
    finally:
        envs.close()


def test_copies_of_a_vec_env_go_on_with_the_same_bits():
    envs = SB3VecEnv(3, "displacement", model="serres2008", control_rate_hz=10.0)
    envs.seed(1)
    envs.reset()
    actions = np.random.default_rng(1).uniform(-1.0, 0.0, (70, 3, 1))
    for action in actions[:45]:
        envs.step(action)
    other = pickle.loads(pickle.dumps(envs))
    for action in actions[45:]:
        seen, its = envs.step(action), other.step(action)
        for one, two in zip(seen[:3], its[:3], strict=True):
            np.testing.assert_array_equal(one, two)
        returns = [[info.get("episode", {}).get(key) for info in seen[3]] for key in "rl"]
        assert returns == [[info.get("episode", {}).get(key) for info in its[3]] for key in "rl"]
