"""The lean policy is Stable-Baselines3's own, up to rounding."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import torch
from gymnasium import spaces
from stable_baselines3 import A2C, PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from torch import nn

from pma_gym.sb3.network import layers_of, network
from pma_gym.sb3.policy import LeanMlpPolicy
from pma_gym.sb3.vec_env import SB3VecEnv

SEEN = spaces.Box(-5.0, 5.0, (7,), np.float32)
MADE = {"model": "serres2008", "pressure_kpa": 300, "control_rate_hz": 10.0}


class Learning(FlattenExtractor):
    """An extractor with parameters of its own."""

    def __init__(self, observation_space):
        super().__init__(observation_space)
        self.scale = nn.Parameter(torch.linspace(0.5, 2.0, 7))

    def forward(self, observations):
        return self.scale * super().forward(observations)


def with_norm(policy):
    policy.mlp_extractor.policy_net.insert(1, nn.LayerNorm(64))


def without_bias(policy):
    policy.mlp_extractor.value_net[2] = nn.Linear(64, 64, bias=False)


def pair(action=(1,), **options):
    """Stable-Baselines3's policy and the lean one, with the same parameters."""
    if isinstance(action, tuple):
        action = spaces.Box(-1.0, 1.0, action, np.float32)
    kinds = ActorCriticPolicy, LeanMlpPolicy
    theirs, ours = (kind(SEEN, action, lambda _: 1e-3, **options) for kind in kinds)
    generator = torch.Generator().manual_seed(5)
    with torch.no_grad():
        for parameter in theirs.parameters():
            parameter += 0.3 * torch.randn(parameter.shape, generator=generator)
    ours.load_state_dict(theirs.state_dict())
    return theirs, ours


def said(policy, rows=300):
    """What a policy says of drawn observations, and its derivatives."""
    generator = torch.Generator().manual_seed(6)
    seen = torch.randn((rows, 7), generator=generator)
    torch.manual_seed(7)
    if policy.use_sde:
        policy.reset_noise(rows)
    with torch.no_grad():
        drawn = policy(seen)
        mode = policy(seen, deterministic=True)
    actions = drawn[0].reshape(rows, -1)
    if isinstance(policy.action_space, spaces.Discrete):
        actions = actions.flatten()
    values, likelihood, entropy = policy.evaluate_actions(seen, actions)
    weights = torch.linspace(-1.0, 2.0, rows)
    loss = (weights * likelihood).mean() + values.square().mean() - 0.1 * entropy.mean()
    loss.backward()
    gradients = [parameter.grad for parameter in policy.parameters()]
    return *drawn, *mode, values, likelihood, entropy, *gradients


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"net_arch": [16]},
        {"net_arch": {"pi": [9, 17, 33], "vf": [64]}},
        {"action": (3,), "log_std_init": -1.5},
        {"action": (2, 2)},
        {"features_extractor_class": Learning, "share_features_extractor": False},
    ],
    ids=str,
)
def test_it_says_and_learns_what_theirs_does(options):
    theirs, ours = pair(**options)
    assert ours.is_lean()
    for its, mine in zip(said(theirs), said(ours), strict=True):
        mine, its = mine.detach(), its.detach()
        assert mine.shape == its.shape and mine.dtype == its.dtype
        full_scale = max(1.0, float(its.abs().max()))
        np.testing.assert_allclose(mine, its, rtol=1e-5, atol=2e-6 * full_scale)


@pytest.mark.parametrize(
    "options",
    [
        {"activation_fn": nn.ReLU},
        {"net_arch": {"pi": [], "vf": [8]}},
        {"action": spaces.Discrete(3)},
        {"use_sde": True},
    ],
    ids=str,
)
def test_what_it_cannot_it_leaves_to_theirs_to_the_bit(options):
    theirs, ours = pair(**options)
    assert not ours.is_lean()
    for its, mine in zip(said(theirs), said(ours), strict=True):
        assert torch.equal(mine, its)


@pytest.mark.parametrize("change", [with_norm, without_bias])
def test_changed_networks_are_left_to_theirs(change):
    theirs, ours = pair()
    for policy in (theirs, ours):
        torch.manual_seed(4)
        change(policy)
    assert not ours.is_lean()
    for its, mine in zip(said(theirs), said(ours), strict=True):
        assert torch.equal(mine, its)


def test_actions_that_are_drawn_have_theirs_derivatives():
    gradients = []
    for policy in pair():
        torch.manual_seed(8)
        actions, _, likelihood = policy(torch.ones(5, 7))
        (actions.sum() + 0.1 * likelihood.square().sum()).backward()
        gradients.append([parameter.grad for parameter in policy.parameters()])
    for its, mine in zip(*gradients, strict=True):
        assert (its is None) == (mine is None)
        if its is not None:
            np.testing.assert_allclose(mine, its, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", ["log_std", "action_net.bias"])
def test_parameters_that_are_lost_are_refused_as_by_theirs(name, monkeypatch):
    # torch.compile, which another test may have used, has them go unnoticed from then on.
    monkeypatch.setattr(torch.distributions.Distribution, "_validate_args", True)
    for policy in pair():
        with torch.no_grad():
            dict(policy.named_parameters())[name].fill_(torch.nan)
        with pytest.raises(ValueError, match="constraint"):
            policy(torch.ones(5, 7))
        with pytest.raises(ValueError, match="constraint"):
            policy.evaluate_actions(torch.ones(5, 7), torch.ones(5, 1))


def test_autocast_is_left_to_theirs():
    theirs, ours = pair()
    for policy in (theirs, ours):
        with torch.autocast("cpu", torch.bfloat16):
            values, *_ = policy.evaluate_actions(torch.ones(5, 7), torch.ones(5, 1))
        values.float().sum().backward()
    for its, mine in zip(theirs.parameters(), ours.parameters(), strict=True):
        if its.grad is not None:
            assert torch.equal(mine.grad, its.grad)


def test_what_is_compiled_is_left_to_theirs():
    theirs, ours = pair()
    compiled = torch.compile(ours.evaluate_actions, backend="eager")
    for _ in range(2):
        gradients = []
        for policy, evaluate in ((theirs, theirs.evaluate_actions), (ours, compiled)):
            policy.zero_grad()
            values, likelihood, _ = evaluate(torch.ones(5, 7), torch.ones(5, 1))
            (values.sum() + likelihood.sum()).backward()
            gradients.append([parameter.grad for parameter in policy.parameters()])
        for its, mine in zip(*gradients, strict=True):
            assert torch.equal(mine, its)


@pytest.mark.parametrize("sizes", [(5, 4, 3), (3, 8, 6, 7, 2)])
def test_its_network_is_the_layers_in_double_precision(sizes):
    torch.manual_seed(1)
    modules = []
    for before, after in zip(sizes[:-1], sizes[1:], strict=True):
        modules += nn.Linear(before, after).double(), nn.Tanh()
    net = nn.Sequential(*modules[:-1])
    seen = torch.randn((11, sizes[0]), dtype=torch.float64, requires_grad=True)
    expected = net(seen).detach()

    def said(*_):
        return network(seen, layers_of(net))

    for outputs in (said(), torch.no_grad()(said)()):
        np.testing.assert_allclose(outputs.detach(), expected, rtol=1e-13, atol=1e-14)
    assert torch.autograd.gradcheck(said, [seen, *net.parameters()])


def test_far_values_are_those_of_tanh():
    far = torch.tensor([[-1e30], [-200.0], [0.0], [200.0], [1e30], [torch.nan]])
    one, two = nn.Linear(1, 1), nn.Linear(1, 1)
    with torch.no_grad():
        for layer in (one, two):
            layer.weight[:], layer.bias[:] = 1.0, 0.0
        values = network(far, layers_of([one, nn.Tanh(), two]))
    np.testing.assert_array_equal(values.flatten(), [-1.0, -1.0, 0.0, 1.0, 1.0, np.nan])


@pytest.mark.parametrize("kind", [PPO, A2C])
def test_models_learn_and_are_stored(kind, tmp_path):
    envs = SB3VecEnv(8, "displacement", **MADE)
    options = {"batch_size": 128} if kind is PPO else {}
    model = kind(LeanMlpPolicy, envs, n_steps=32, seed=0, device="cpu", **options)
    before = [parameter.clone() for parameter in model.policy.parameters()]
    model.learn(512)
    for then, now in zip(before, model.policy.parameters(), strict=True):
        assert not torch.equal(then, now)
    model.save(tmp_path / "model.zip")
    again = kind.load(tmp_path / "model.zip", envs, device="cpu")
    assert type(again.policy) is LeanMlpPolicy
    plain = kind("MlpPolicy", envs, device="cpu")
    plain.policy.load_state_dict(again.policy.state_dict())
    seen = envs.reset()
    for other in (again, plain):
        np.testing.assert_array_equal(
            model.predict(seen, deterministic=True)[0], other.predict(seen, deterministic=True)[0]
        )


def test_a_training_ends_where_theirs_does_after_a_few_steps():
    ended = []
    for policy in ("MlpPolicy", LeanMlpPolicy):
        envs = SB3VecEnv(8, "displacement", **MADE)
        model = PPO(policy, envs, n_steps=32, batch_size=128, n_epochs=2, seed=3, device="cpu")
        ended.append(list(model.learn(256).policy.parameters()))
    for its, mine in zip(*ended, strict=True):
        np.testing.assert_allclose(mine.detach(), its.detach(), atol=1e-4)


def learned(policy, rows, seed, times=1):
    """Derivatives of a loss of drawn observations, whose graph is gone through a few times."""
    generator = torch.Generator().manual_seed(seed)
    seen = torch.randn((rows, 7), generator=generator)
    values, likelihood, _ = policy.evaluate_actions(seen, torch.ones(rows, 1))
    loss = likelihood.mean() + values.square().mean()

    def derivatives():
        policy.zero_grad()
        for _ in range(times):
            loss.backward(retain_graph=True)
        return [parameter.grad.clone() for parameter in policy.parameters()]

    return derivatives


@pytest.mark.parametrize("times", [1, 2])
def test_minibatches_whose_graphs_live_together_have_memory_of_their_own(times):
    for policy in pair():
        expected = [learned(policy, 50, seed, times)() for seed in (1, 2)]
        waiting = [learned(policy, 50, seed, times) for seed in (1, 2)]
        for gradient, own in zip(waiting, expected, strict=True):
            for one, other in zip(gradient(), own, strict=True):
                assert torch.equal(one, other)
