"""Stable-Baselines3's PPO on a batch: `python docs/examples/sb3_ppo.py [STEPS]`."""

import sys

import numpy as np
from stable_baselines3 import PPO

from pma_gym.sb3 import SB3VecEnv

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 300_000

envs = SB3VecEnv(64, "displacement", pressure_kpa=300, preview=3, history=3)
settings = {"n_steps": 64, "batch_size": 1024, "n_epochs": 5, "learning_rate": 1e-3, "gamma": 0.95}
network = {"net_arch": [64, 64], "log_std_init": -1.5}
model = PPO("MlpPolicy", envs, policy_kwargs=network, device="cpu", seed=1, **settings)
model.learn(steps)

envs.seed(2)
seen, ended = envs.reset(), np.zeros(64, bool)
while not ended.all():
    seen, _, ended, infos = envs.step(model.predict(seen, deterministic=True)[0])
print(f"RMSE {np.mean([info['rmse_mm'] for info in infos]):.3f} mm")
