"""Stable-Baselines3: batched environments as its VecEnv, and PPO with less arithmetic.

It needs the extra `rl`.
"""

from pma_gym.sb3.policy import LeanMlpPolicy
from pma_gym.sb3.ppo import LeanPPO
from pma_gym.sb3.vec_env import EngineVecEnv, SB3VecEnv

__all__ = ["EngineVecEnv", "LeanMlpPolicy", "LeanPPO", "SB3VecEnv"]
