"""RLlib's PPO on environments in its workers: `python docs/examples/rllib_ppo.py [STEPS]`."""

import sys

import torch
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune import register_env

from pma_gym import PMAEnv

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 40_960
options = {"pressure_kpa": 300, "preview": 3, "history": 3}

register_env("displacement", lambda options: PMAEnv("displacement", **options))
config = PPOConfig().environment("displacement", env_config=options).debugging(seed=1)
config.env_runners(num_env_runners=1, num_envs_per_env_runner=16)
config.training(train_batch_size=4096, minibatch_size=1024, num_epochs=5, lr=1e-3, gamma=0.95)
# Rewards are in percent of the range: RLlib's usual clip, 10, would stop the value's learning.
config.training(vf_clip_param=1e6, clip_param=0.2, use_kl_loss=False, lambda_=0.9)
config.rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64]))
algorithm = config.build_algo()
for _ in range(max(1, steps // 4096)):
    algorithm.train()

policy, env, ended = algorithm.get_module(), PMAEnv("displacement", **options), False
seen, info = env.reset(seed=2)
while not ended:
    mean, _ = policy.forward_inference({"obs": torch.tensor(seen[None])})["action_dist_inputs"][0]
    seen, _, terminated, truncated, info = env.step(mean.detach().numpy().reshape(1))
    ended = terminated or truncated
print(f"RMSE {info['rmse_mm']:.3f} mm")
algorithm.stop()
