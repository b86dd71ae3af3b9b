"""Stable-Baselines3's checker finds nothing to say, and one of its algorithms runs."""

import gymnasium as gym
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env

from pma_gym.envs import ENVIRONMENTS

OPTIONS = [
    {},
    {"preview": 4, "history": 3},
    {"regulator_action": True, "randomisation": "varied", "pressure_kpa": "random"},
    {"render_mode": "rgb_array"},
    {"model": "station", "pressure_kpa": "random"},
]
MADE = {"model": "serres2008", "pressure_kpa": 300}


@pytest.mark.parametrize("name", ENVIRONMENTS)
@pytest.mark.parametrize("options", OPTIONS, ids=lambda options: ",".join(options) or "defaults")
def test_check_env_finds_nothing_to_say(name, options):
    if "Isotonic" in name or "Exercise" in name:
        # Its action is the regulator's already.
        options = {k: v for k, v in options.items() if k != "regulator_action"}
    # pytest turns each warning into an error.
    check_env(gym.make(name, **(MADE | options)), warn=True)


def test_an_agent_learns_through_the_ends_of_episodes():
    env = gym.make("pma_gym/IsokineticDisplacement-v0", control_rate_hz=10.0, **MADE)
    agent = PPO("MlpPolicy", env, n_steps=64, batch_size=32, seed=0, device="cpu")
    agent.learn(128)
    action, _ = agent.predict(env.reset(seed=0)[0], deterministic=True)
    assert env.action_space.contains(action)
