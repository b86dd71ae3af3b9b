"""PPO in PyTorch alone, the whole of it: `python docs/examples/ppo_torch.py [STEPS]`."""

import sys

import gymnasium as gym
import torch
from torch import nn
from torch.distributions import Normal

import pma_gym  # noqa: F401 - registers the environments

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 300_000
task = "pma_gym/IsokineticDisplacement-v0"
envs = gym.make_vec(task, num_envs=64, pressure_kpa=300, preview=3, history=3)
torch.manual_seed(1)


def network() -> nn.Sequential:
    """From an observation to the mean of the action, or to the value."""
    size = envs.single_observation_space.shape[0]
    layers = nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1)
    return nn.Sequential(*layers)


actor, critic, log_std = network(), network(), nn.Parameter(torch.tensor(-1.5))
adam = torch.optim.Adam([*actor.parameters(), *critic.parameters(), log_std], 1e-3)
seen, begins = torch.tensor(envs.reset(seed=1)[0]), torch.zeros(64)

for _ in range(max(1, steps // (64 * 64))):
    # Gather 64 steps of the 64 environments.
    rollout = []
    for _ in range(64):
        with torch.no_grad():
            action = Normal(actor(seen), log_std.exp()).sample()
        after, reward, fell, cut = map(torch.tensor, envs.step(action.numpy())[:4])
        rollout.append((seen, action, 0.01 * reward.float(), fell, fell | cut, after, begins))
        seen, begins = after, (fell | cut).float()
    # How much better than expected each action was (generalised advantage estimation).
    s, a, r, fell, over, after, first_step = map(torch.stack, zip(*rollout, strict=True))
    with torch.no_grad():
        before = Normal(actor(s), log_std.exp()).log_prob(a)
        value = critic(s)[..., 0]
        gain = r + 0.95 * critic(after)[..., 0] * ~fell - value
        for t in range(62, -1, -1):
            gain[t] += 0.95 * 0.9 * gain[t + 1] * ~over[t]
    # Better actions more probable, within the clip; a step that only begins an episode is none.
    real = (first_step == 0).nonzero()
    for batch in real[torch.randperm(5 * len(real)) % len(real)].split(1024):
        i = batch.unbind(1)
        better = (gain[i] - gain[i].mean()) / gain[i].std()
        ratio = (Normal(actor(s[i]), log_std.exp()).log_prob(a[i]) - before[i])[:, 0].exp()
        gained = torch.minimum(ratio * better, ratio.clamp(0.8, 1.2) * better)
        loss = (critic(s[i])[:, 0] - value[i] - gain[i]).square().mean() - gained.mean()
        adam.zero_grad()
        loss.backward()
        adam.step()

seen, info = envs.reset(seed=2)
while "rmse_mm" not in info:
    with torch.no_grad():
        seen, *_, info = envs.step(actor(torch.tensor(seen)).numpy())
print(f"RMSE {info['rmse_mm'][info['_rmse_mm']].mean():.3f} mm")
