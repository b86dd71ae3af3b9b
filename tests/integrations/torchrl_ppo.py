"""TorchRL: `GymEnv` by id, `GymWrapper` around batches, and a short PPO training."""

import gymnasium as gym
import torch
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, GymWrapper
from torchrl.modules import MLP, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

ID = "pma_gym:pma_gym/IsokineticDisplacement-v0"
BATCHES, FRAMES = 3, 512


def train() -> float:
    """Train on the registered environment; the mean reward of the last batch."""
    torch.manual_seed(1)
    env = GymEnv(ID, control_rate_hz=20.0)
    entries, actions = env.observation_spec["observation"].shape[-1], env.action_spec.shape[-1]
    network = nn.Sequential(MLP(entries, 2 * actions, num_cells=[64, 64]), NormalParamExtractor())
    actor = ProbabilisticActor(
        TensorDictModule(network, ["observation"], ["loc", "scale"]),
        spec=env.action_spec,
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    critic = ValueOperator(MLP(entries, 1, num_cells=[64, 64]), ["observation"])
    loss, advantage = ClipPPOLoss(actor, critic), GAE(gamma=0.95, lmbda=0.9, value_network=critic)
    optimiser = torch.optim.Adam(loss.parameters(), 1e-3)
    collector = Collector(env, actor, frames_per_batch=FRAMES, total_frames=BATCHES * FRAMES)
    reward = float("nan")
    for data in collector:
        for _ in range(2):
            advantage(data)
            losses = loss(data.reshape(-1))
            total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
            optimiser.zero_grad()
            total.backward()
            optimiser.step()
        reward = data["next", "reward"].mean().item()
    collector.shutdown()
    return reward


def roll_out(mode: str) -> int:
    """Step a batch through the ends of its episodes; how many episodes ended."""
    envs = gym.make_vec(ID, 3, autoreset_mode=mode, control_rate_hz=20.0)
    data = GymWrapper(envs).rollout(250, break_when_any_done=False)
    return int(data["next", "done"].sum())


if __name__ == "__main__":
    ends = {mode: roll_out(mode) for mode in ("SameStep", "Disabled")}
    assert min(ends.values()) > 3, ends
    reward = train()
    assert reward == reward and reward < 0.0
    print(f"PPO {BATCHES * FRAMES} steps by id; GymWrapper of batches, ends {ends}")
