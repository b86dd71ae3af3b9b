"""skrl: PPO on a single environment and on a batch, both by id."""

import tempfile

import gymnasium as gym
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from torch import nn

ID = "pma_gym:pma_gym/IsokineticDisplacement-v0"
STEPS = 512


def network(entries: int, outputs: int) -> nn.Module:
    return nn.Sequential(nn.Linear(entries, 32), nn.Tanh(), nn.Linear(32, outputs))


class Policy(GaussianMixin, Model):
    def __init__(self, **spaces):
        Model.__init__(self, **spaces)
        GaussianMixin.__init__(self, clip_actions=True)
        self.net = network(self.num_observations, self.num_actions)
        self.log_std = nn.Parameter(torch.zeros(self.num_actions))

    def compute(self, inputs, role):
        return self.net(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    def __init__(self, **spaces):
        Model.__init__(self, **spaces)
        DeterministicMixin.__init__(self)
        self.net = network(self.num_observations, 1)

    def compute(self, inputs, role):
        return self.net(inputs["observations"]), {}


def train(made) -> None:
    """Train through the ends of episodes; the policy's parameters have moved."""
    set_seed(1)
    env = wrap_env(made)
    spaces = {
        "observation_space": env.observation_space,
        "state_space": env.state_space,
        "action_space": env.action_space,
        "device": env.device,
    }
    models = {"policy": Policy(**spaces), "value": Value(**spaces)}
    before = models["policy"].net[0].weight.detach().clone()
    cfg = PPO_CFG()
    cfg.rollouts = 128
    cfg.experiment.directory = tempfile.mkdtemp()
    cfg.experiment.write_interval = cfg.experiment.checkpoint_interval = 0
    agent = PPO(
        models=models,
        memory=RandomMemory(memory_size=128, num_envs=env.num_envs, device=env.device),
        cfg=cfg,
        observation_space=env.observation_space,
        state_space=env.state_space,
        action_space=env.action_space,
        device=env.device,
    )
    options = {"timesteps": STEPS, "headless": True, "disable_progressbar": True}
    SequentialTrainer(cfg=options, env=env, agents=agent).train()
    weight = models["policy"].net[0].weight
    assert torch.isfinite(weight).all() and not torch.equal(weight, before)


if __name__ == "__main__":
    train(gym.make(ID, control_rate_hz=20.0))
    train(gym.make_vec(ID, 4, control_rate_hz=20.0))
    print(f"PPO {STEPS} steps on a single environment and on a batch of 4")
