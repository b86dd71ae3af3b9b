"""Stable-Baselines3: batched environments as its VecEnv, and PPO with less arithmetic.

It needs the extra `rl`.
"""

try:
    from pma_gym.sb3.policy import LeanMlpPolicy
    from pma_gym.sb3.ppo import LeanPPO
    from pma_gym.sb3.vec_env import EngineVecEnv, SB3VecEnv
except ModuleNotFoundError as error:
    missing = str(error.name).partition(".")[0]
    raise ModuleNotFoundError(
        f'pma_gym.sb3 needs {missing}, which is not installed: pip install "pma-gym[rl]"',
        name=missing,
    ) from None

__all__ = ["EngineVecEnv", "LeanMlpPolicy", "LeanPPO", "SB3VecEnv"]
