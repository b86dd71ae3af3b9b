"""Stable-Baselines3's checker finds nothing to say."""

import gymnasium as gym
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.env_checker import check_env

from pma_gym.envs import ENVIRONMENTS


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_check_env_finds_nothing_to_say(name):
    # pytest turns each warning into an error.
    check_env(gym.make(name, render_mode="rgb_array"), warn=True)
