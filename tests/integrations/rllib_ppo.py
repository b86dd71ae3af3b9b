"""RLlib: PPO by the registered id, in two processes of Ray."""

import gymnasium as gym
import ray
from ray.rllib.algorithms.ppo import PPOConfig

ID = "pma_gym:pma_gym/IsokineticDisplacement-v0"

if __name__ == "__main__":
    ray.init(num_cpus=3, include_dashboard=False, log_to_driver=False)
    config = PPOConfig().environment(ID, env_config={"pressure_kpa": 300, "control_rate_hz": 20.0})
    config.env_runners(num_env_runners=2, num_envs_per_env_runner=2).debugging(seed=1)
    config.training(train_batch_size=1024, minibatch_size=256, num_epochs=2, vf_clip_param=1e6)
    algorithm = config.build_algo()
    for _ in range(2):
        result = algorithm.train()
    returned = result["env_runners"]["episode_return_mean"]
    assert returned < 0.0
    steps = int(result["num_env_steps_sampled_lifetime"])
    print(f"PPO {steps} steps by id in 2 runners, Gymnasium {gym.__version__}")
    algorithm.stop()
    ray.shutdown()
