"""CleanRL's pattern: its stack of Gymnasium's wrappers in a `SyncVectorEnv`, and a short PPO.

The package `cleanrl` is older than Gymnasium; the last line quotes what it says when imported.
"""

import importlib
import warnings

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

ID = "pma_gym:pma_gym/IsokineticDisplacement-v0"
COUNT, STEPS, UPDATES, GAMMA, LAMBDA = 4, 128, 3, 0.95, 0.9


def make() -> gym.Env:
    """One environment in the wrappers of CleanRL's script for continuous actions."""
    env = gym.wrappers.FlattenObservation(gym.make(ID, control_rate_hz=20.0))
    env = gym.wrappers.ClipAction(gym.wrappers.RecordEpisodeStatistics(env))
    env = gym.wrappers.NormalizeObservation(env)
    space = env.observation_space
    env = gym.wrappers.TransformObservation(env, lambda seen: np.clip(seen, -10, 10), space)
    env = gym.wrappers.NormalizeReward(env, gamma=GAMMA)
    return gym.wrappers.TransformReward(env, lambda reward: float(np.clip(reward, -10, 10)))


class Agent(nn.Module):
    """Actor and critic."""

    def __init__(self, entries: int, actions: int):
        super().__init__()
        self.critic = nn.Sequential(nn.Linear(entries, 64), nn.Tanh(), nn.Linear(64, 1))
        self.actor = nn.Sequential(nn.Linear(entries, 64), nn.Tanh(), nn.Linear(64, actions))
        self.log_std = nn.Parameter(torch.zeros(actions))

    def policy(self, seen):
        """The actions' distribution."""
        return Normal(self.actor(seen), self.log_std.exp())


def advantages(rewards, values, over, last):
    """Generalised advantage estimates, shape (steps, environments)."""
    estimates, running = torch.zeros_like(rewards), torch.zeros(rewards.shape[1])
    for t in reversed(range(len(rewards))):
        after = values[t + 1] if t + 1 < len(rewards) else last
        running = rewards[t] - values[t] + (~over[t]) * GAMMA * (after + LAMBDA * running)
        estimates[t] = running
    return estimates


def update(agent, optimiser, seen, actions, logs, gains, targets) -> None:
    """Four passes with the clipped objective."""
    for _ in range(4):
        ratio = (agent.policy(seen).log_prob(actions).sum(-1) - logs).exp()
        clipped = ratio.clamp(0.8, 1.2)
        value_loss = (agent.critic(seen).squeeze(-1) - targets).square().mean()
        loss = 0.5 * value_loss - torch.min(ratio * gains, clipped * gains).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()


def train() -> list[float]:
    """Train; the returns of the episodes that ended, as RecordEpisodeStatistics has them."""
    torch.manual_seed(1)
    envs = gym.vector.SyncVectorEnv([make] * COUNT)
    agent = Agent(envs.single_observation_space.shape[0], envs.single_action_space.shape[0])
    optimiser = torch.optim.Adam(agent.parameters(), 1e-3)
    seen, returns = torch.tensor(envs.reset(seed=1)[0], dtype=torch.float32), []
    for _ in range(UPDATES):
        rows = []
        for _ in range(STEPS):
            with torch.no_grad():
                policy = agent.policy(seen)
                action = policy.sample()
                kept = seen, action, policy.log_prob(action).sum(-1), agent.critic(seen)[:, 0]
            after, reward, terminated, truncated, info = envs.step(action.numpy())
            over = torch.tensor(terminated | truncated)
            rows.append((*kept, torch.tensor(reward, dtype=torch.float32), over))
            if "episode" in info:
                returns += info["episode"]["r"][info["_episode"]].tolist()
            seen = torch.tensor(after, dtype=torch.float32)
        observed, actions, logs, values, rewards, ended = (
            torch.stack(x) for x in zip(*rows, strict=True)
        )
        with torch.no_grad():
            gains = advantages(rewards, values, ended, agent.critic(seen)[:, 0])
        scaled = (gains - gains.mean()) / (gains.std() + 1e-8)
        update(agent, optimiser, observed, actions, logs, scaled, gains + values)
    assert all(torch.isfinite(one).all() for one in agent.parameters())
    return returns


def package() -> str:
    """What importing the package's own script says."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            importlib.import_module("cleanrl.ppo_continuous_action")
    except ImportError as error:
        return str(error).split(" (")[0]
    return "imported"


if __name__ == "__main__":
    returns = train()
    assert len(returns) > 3 and max(returns) < 0.0, returns
    print(
        f"its pattern with Gymnasium {gym.__version__}, PPO {COUNT * STEPS * UPDATES} steps; "
        f"the package itself: {package()}"
    )
