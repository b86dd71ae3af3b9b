"""A thousand stations at once: one call steps them all."""

# %%
import gymnasium as gym
import numpy as np

import pma_gym  # noqa: F401 - registers the environments

envs = gym.make_vec("pma_gym/IsokineticDisplacement-v0", num_envs=1000, pressure_kpa="random")
observation, info = envs.reset(seed=1)
print("observations", observation.shape)

# %% The same half voltage for all, until the first episodes end.
ended = np.zeros(1000, bool)
while not ended.any():
    action = np.zeros(envs.action_space.shape, np.float32)
    observation, reward, terminated, truncated, info = envs.step(action)
    ended = terminated | truncated
print(f"{ended.sum()} episodes ended, mean reward of the last step {reward.mean():.2f}")
assert np.isfinite(reward).all()
