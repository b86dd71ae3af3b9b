"""The lean PPO learns what Stable-Baselines3's does."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import gymnasium as gym
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import FlattenExtractor
from torch import nn

import pma_gym.sb3.ppo as sb3_ppo
import pma_gym.sb3.ppo as sb3_threads
from pma_gym.sb3.network import derivatives
from pma_gym.sb3.policy import LeanMlpPolicy
from pma_gym.sb3.ppo import LeanPPO
from pma_gym.sb3.vec_env import SB3VecEnv

pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")

MADE = {"model": "serres2008", "pressure_kpa": 300, "control_rate_hz": 10.0}
SETTINGS = {"n_steps": 64, "batch_size": 24, "n_epochs": 3, "learning_rate": 3e-3, "seed": 3}


class Mass(gym.Env):
    """A mass that is to rest at zero, pushed by a few forces; it may succeed."""

    def __init__(self, actions=2, shape=(3,), action_space=None):
        self.observation_space = spaces.Box(-9.0, 9.0, shape, np.float32)
        self.action_space = action_space or spaces.Box(-1.0, 1.0, (actions,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state, self.count = self.np_random.normal(size=2), 0
        return self._seen(), {}

    def _seen(self):
        seen = np.full(self.observation_space.shape, 0.1 * self.count, np.float32)
        seen.flat[:2] = self.state
        return np.clip(seen, -9.0, 9.0)

    def step(self, action):
        force = float(np.sum(action))
        self.state = self.state + 0.3 * np.array([self.state[1], force])
        self.count += 1
        rest = float(np.abs(self.state).sum())
        info = {"is_success": rest < 1.0} if self.count == 10 else {}
        return self._seen(), -rest, rest > 12.0, self.count == 10, info


def learned(kind, policy="MlpPolicy", steps=128, env=None, change=None, **options):
    model = kind(policy, env or Mass(), device="cpu", **(SETTINGS | options))
    if change:
        change(model)
    return model.learn(steps)


def assert_same(theirs, ours, rtol=2e-4):
    for (name, its), mine in zip(
        theirs.policy.state_dict().items(), ours.policy.state_dict().values(), strict=True
    ):
        np.testing.assert_allclose(mine, its, rtol=rtol, atol=rtol, err_msg=name)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"batch_size": 32, "ent_coef": 0.3, "vf_coef": 0.1},
        {"batch_size": 500, "learning_rate": 1e-2},
        {"clip_range": 0.01, "clip_range_vf": 0.02},
        {"normalize_advantage": False, "max_grad_norm": 1e-3},
        {"max_grad_norm": 1e9, "gamma": 0.9},
        {"target_kl": 1e-4, "verbose": 1},
        {"learning_rate": lambda left: 1e-3 * left, "clip_range": lambda left: 0.05 + 0.1 * left},
        {"env": Mass(actions=1)},
        {"policy_kwargs": {"net_arch": {"pi": [9, 17, 33], "vf": [5]}, "log_std_init": -0.7}},
        {"policy_kwargs": {"share_features_extractor": False}},
    ],
    ids=lambda options: ",".join(options),
)
def test_it_learns_and_logs_what_theirs_does(options, capsys):
    theirs = learned(PPO, **options)
    said = capsys.readouterr().out
    ours = learned(LeanPPO, **options)
    assert ours.is_lean() and type(ours.policy) is LeanMlpPolicy
    assert_same(theirs, ours)
    its, mine = theirs.logger.name_to_value, ours.logger.name_to_value
    assert set(its) == set(mine)
    for name in its.keys() - {"time/fps", "time/time_elapsed"}:
        np.testing.assert_allclose(mine[name], its[name], rtol=2e-3, atol=1e-6, err_msg=name)
    assert list(theirs.ep_success_buffer) == list(ours.ep_success_buffer) != []
    episodes = [[one["r"] for one in model.ep_info_buffer] for model in (theirs, ours)]
    np.testing.assert_allclose(*episodes, rtol=1e-4)
    if "target_kl" in options:
        stops = [
            text.count("Early stopping at step 0 ") for text in (said, capsys.readouterr().out)
        ]
        assert stops == [2, 2]
        assert ours._n_updates == 2


def test_clipping_counts_in_what_is_compared():
    free, clipped = (learned(LeanPPO, clip_range=clip).logger.name_to_value for clip in (9, 0.01))
    assert free["train/clip_fraction"] == 0.0 < 0.1 < clipped["train/clip_fraction"]


def test_one_thread_and_two_learn_the_same_bits(monkeypatch):
    had, before, parameters = [], torch.get_num_threads(), []

    def watched(*args):
        had.append(torch.get_num_threads())
        return derivatives(*args)

    def trained(allowed, most_alone, first, **options):
        """Parameters after a training of 6 minibatches, so large that threads do share them."""
        options = {"n_steps": 1500, "batch_size": 1000, "steps": 1500, "seed": 4} | options
        model = learned(LeanPPO, **options)
        monkeypatch.setattr(sb3_ppo, "derivatives", watched)
        monkeypatch.setattr(sb3_ppo, "MOST_ALONE", most_alone)
        monkeypatch.setattr(sb3_threads, "FIRST", first)
        # However long two threads take here.
        monkeypatch.setattr(sb3_threads, "PATIENCE", 1e9)
        torch.set_num_threads(allowed)
        np.random.seed(5)
        model.train()
        assert torch.get_num_threads() == allowed
        monkeypatch.undo()
        torch.set_num_threads(before)
        return [one.clone() for one in model.policy.state_dict().values()]

    try:
        for settings in ((1, 0, 1), (2, 0, 1), (5, 0, 4), (2, 1 << 40, 1)):
            parameters.append(trained(*settings, env=Mass(actions=1)))
        trained(2, 0, 1, env=Mass(actions=2))
    finally:
        torch.set_num_threads(before)
    assert had[:24] == [1] * 6 + [1] + [2] * 5 + [1] * 4 + [2] * 2 + [1] * 6
    # Those of other shapes are not shared: their bits do depend on the number of threads.
    assert had[24:] == [1] * 12
    for same in zip(*parameters, strict=True):
        assert all(torch.equal(same[0], one) for one in same)


class Doubling(FlattenExtractor):
    def forward(self, observations):
        return 2.0 * super().forward(observations)


def freeze(model):
    model.policy.value_net.bias.requires_grad_(False)


@pytest.mark.parametrize(
    "options",
    [
        {"env": Mass(shape=(3, 1))},
        {"env": Mass(action_space=spaces.Discrete(3))},
        {"policy_kwargs": {"activation_fn": nn.ReLU}},
        {"policy_kwargs": {"features_extractor_class": Doubling}},
        {"use_sde": True},
        {"change": freeze},
    ],
    ids=["observations", "actions", "activation", "extractor", "exploration", "frozen"],
)
def test_what_it_cannot_it_leaves_to_theirs_to_the_bit(options):
    theirs, ours = (learned(kind, LeanMlpPolicy, **options) for kind in (PPO, LeanPPO))
    assert not ours.is_lean()
    for its, mine in zip(theirs.policy.parameters(), ours.policy.parameters(), strict=True):
        assert torch.equal(mine, its)


def test_it_learns_in_a_batch_and_its_files_are_theirs(tmp_path):
    envs = SB3VecEnv(8, "displacement", **MADE)
    options = {"n_steps": 32, "batch_size": 128, "n_epochs": 2, "seed": 3, "device": "cpu"}
    theirs = PPO("MlpPolicy", SB3VecEnv(8, "displacement", **MADE), **options).learn(512)
    ours = LeanPPO("MlpPolicy", envs, **options).learn(512)
    assert_same(theirs, ours)
    theirs.save(tmp_path / "theirs.zip")
    policy = {"policy_class": LeanMlpPolicy}
    changed = LeanPPO.load(tmp_path / "theirs.zip", envs, device="cpu", custom_objects=policy)
    assert_same(theirs, changed, rtol=0.0)
    assert changed.learn(256).is_lean()
    ours.save(tmp_path / "model.zip")
    for kind in (PPO, LeanPPO):
        again = kind.load(tmp_path / "model.zip", envs, device="cpu")
        assert_same(ours, again, rtol=0.0)
        assert again.policy.optimizer.state_dict()["state"].keys() == set(range(13))
        again.learn(256)
        assert again.is_lean() if kind is LeanPPO else again.num_timesteps == 256


@pytest.mark.parametrize("name", ["log_std", "action_net.bias"])
def test_parameters_that_are_lost_are_refused_and_threads_come_back(name, monkeypatch):
    # torch.compile, which another test may have used, has them go unnoticed from then on.
    monkeypatch.setattr(torch.distributions.Distribution, "_validate_args", True)
    model = learned(LeanPPO)
    before = torch.get_num_threads()
    with torch.no_grad():
        dict(model.policy.named_parameters())[name].fill_(torch.nan)
    for attempt in (model.train, lambda: model.learn(64)):
        with pytest.raises(ValueError, match="constraint"):
            attempt()
        assert torch.get_num_threads() == before
    assert model.policy._held is None


def test_actions_drawn_while_parameters_are_held_are_the_same():
    policy = learned(LeanPPO).policy
    seen = torch.linspace(-1.0, 1.0, 15).reshape(5, 3)

    def drawn():
        torch.manual_seed(2)
        return policy(seen)

    with torch.no_grad():
        expected = drawn()
        with policy.held():
            laws = drawn()
            mode, *_ = policy(seen, deterministic=True)
            for mine, its in zip(laws, expected, strict=True):
                np.testing.assert_allclose(mine, its, rtol=1e-5, atol=1e-6)
            usual = policy.get_distribution(seen).mode()
            np.testing.assert_allclose(mode, usual, rtol=1e-5, atol=1e-6)
            # Who changes parameters all the same gets what they say.
            policy.action_net.bias += 1.0
            moved, values, _ = drawn()
        again = drawn()
    np.testing.assert_array_equal(moved, again[0])
    np.testing.assert_allclose(moved, expected[0] + 1.0, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(values, again[1])
    with policy.held():
        assert policy(seen)[1].requires_grad


def test_a_callback_that_changes_parameters_during_a_rollout_is_heard():
    from stable_baselines3.common.callbacks import BaseCallback

    class Moving(BaseCallback):
        def _on_step(self):
            if self.n_calls == 20:
                with torch.no_grad():
                    self.model.policy.value_net.bias.fill_(50.0)
            return True

    values = []
    for kind in (PPO, LeanPPO):
        model = kind("MlpPolicy", Mass(), device="cpu", **SETTINGS)
        model.learn(64, callback=Moving())
        values.append(model.rollout_buffer.values.copy())
    np.testing.assert_allclose(values[1], values[0], rtol=1e-4, atol=1e-4)
    assert values[1].max() > 40.0
