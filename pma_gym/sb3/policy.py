"""Stable-Baselines3's MlpPolicy with less arithmetic on a processor."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from torch import Tensor, nn

from pma_gym.sb3.network import Layers, is_plain, layers_of, network, passed, scaled

HALF_LOG_TAU = 0.5 * math.log(2.0 * math.pi)


class LeanMlpPolicy(ActorCriticPolicy):
    """`MlpPolicy` of PPO and A2C, with the same parameters and less to compute.

    Actions, values, likelihoods and derivatives are those of `ActorCriticPolicy` up to rounding:
    within 1e-5 of full scale. Its `state_dict` is the same, so that weights go from one to the
    other, and policy files are exported from it as from `MlpPolicy`. Actions are drawn with the
    same random numbers.

    `ActorCriticPolicy` computes, at its own speed, networks other than Linear layers with Tanh
    between them, actions that are not Gaussian, gSDE, autocast, code under `torch.compile`, and
    devices other than the processor. Only first derivatives are available, and they are not traced.

    Example:
        >>> from stable_baselines3 import PPO
        >>> from pma_gym.sb3.vec_env import SB3VecEnv
        >>> envs = SB3VecEnv(64, "displacement", pressure_kpa=300)
        >>> model = PPO(LeanMlpPolicy, envs, n_steps=64, batch_size=1024, device="cpu")
        >>> _ = model.learn(4096)
    """

    _held: "_Held | None" = None

    def forward(self, obs: Tensor, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Return actions, values and log-likelihoods of the actions; see `ActorCriticPolicy`."""
        held = self._held
        if held is not None and not deterministic and held.is_current():
            return held.drawn(obs)
        if not self.is_lean():
            return super().forward(obs, deterministic)
        mean, values = self._mean_and_values(obs)
        drawn = mean if deterministic else mean + self.log_std.exp() * torch.randn_like(mean)
        actions = drawn.reshape(-1, *(self.action_space.shape or ()))
        return actions, values, self._log_likelihood(drawn, mean)

    def evaluate_actions(
        self,
        obs: Any,  # noqa: ANN401 - as the base class has it
        actions: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        """Return values, log-likelihoods of the actions, and entropies; see the base class."""
        if not self.is_lean():
            return super().evaluate_actions(obs, actions)
        mean, values = self._mean_and_values(obs)
        entropy = (self.log_std + (0.5 + HALF_LOG_TAU)).sum().expand(len(actions))
        return values, self._log_likelihood(actions, mean), entropy

    def is_lean(self) -> bool:
        """Return whether the lean computation applies; else `ActorCriticPolicy` computes."""
        return (
            type(self.action_dist) is DiagGaussianDistribution
            and type(self.mlp_extractor) is MlpExtractor
            and self.log_std.device.type == "cpu"
            and not torch.is_autocast_enabled("cpu")
            and not torch.compiler.is_compiling()
            and all(is_plain(modules) for modules in self.networks())
        )

    @contextmanager
    def held(self) -> Iterator[None]:
        """Draw actions faster, without gradients, while parameters stay unchanged.

        Quantities that depend only on parameters are computed once. Observations must be flat, with
        no feature extractor. If parameters change, actions are drawn in the usual way. (A write to
        a parameter's `data` is not detected.)
        """
        self._held = _Held(self)
        try:
            yield
        finally:
            self._held = None

    def networks(self) -> tuple[list[nn.Module], list[nn.Module]]:
        """Return the modules of actor and critic, in order."""
        nets = self.mlp_extractor
        return [*nets.policy_net, self.action_net], [*nets.value_net, self.value_net]

    def layers(self) -> list[Layers]:
        """Return weights and biases of actor and critic."""
        return [layers_of(modules) for modules in self.networks()]

    def _mean_and_values(self, obs: Any) -> tuple[Tensor, Tensor]:  # noqa: ANN401
        features = self.extract_features(obs)
        of_actor, of_critic = features if isinstance(features, tuple) else (features, features)
        actor, critic = self.layers()
        mean = network(of_actor, actor)
        self.check_mean(mean)
        return mean, network(of_critic, critic)

    def check_mean(self, mean: Tensor) -> None:
        """Refuse NaN in means or deviations, as `ActorCriticPolicy` does.

        Raises:
            ValueError: NaN; the message names the parameter and its values.
        """
        if (mean + self.log_std).isnan().any():
            self.action_dist.proba_distribution(mean, self.log_std)

    def _log_likelihood(self, actions: Tensor, mean: Tensor) -> Tensor:
        """Log-likelihood of a normal distribution, summed over entries; shape (rows,)."""
        deviations = (actions - mean) * (-self.log_std).exp()
        constant = (self.log_std + HALF_LOG_TAU).sum()
        return -0.5 * deviations.square().sum(dim=1) - constant


class _Held:
    """Precomputed layers that draw actions while the policy's parameters are unchanged."""

    def __init__(self, policy: LeanMlpPolicy) -> None:
        self._parameters = list(policy.parameters())
        self._versions = [one._version for one in self._parameters]
        self._policy, self._shape = policy, policy.action_space.shape or ()
        with torch.no_grad():
            self._actor, self._critic = (scaled(layers) for layers in policy.layers())
            self._deviation = policy.log_std.exp()
            self._constant = (policy.log_std + HALF_LOG_TAU).sum()

    def is_current(self) -> bool:
        """Return whether the parameters are unchanged and gradients are off."""
        versions = [one._version for one in self._parameters]
        return versions == self._versions and not torch.is_grad_enabled()

    def drawn(self, obs: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return what the policy's `forward` returns."""
        seen = obs.float()
        mean = passed(seen, self._actor)[-1]
        self._policy.check_mean(mean)
        noise = torch.randn_like(mean)
        actions = (mean + self._deviation * noise).reshape(-1, *self._shape)
        likelihoods = -0.5 * noise.square().sum(dim=1) - self._constant
        return actions, passed(seen, self._critic)[-1], likelihoods
