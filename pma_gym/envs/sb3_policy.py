"""Stable-Baselines3's MlpPolicy with less arithmetic on a processor.

A hidden layer's tanh is computed from the logistic function s, for PyTorch's tanh costs three times
as much, and what is linear is left to the products of matrices:

    h_k = tanh(W_k h_(k-1) + b_k) = 2 s_k - 1
    s_1 = s(2 (W_1 x + b_1))
    s_k = s(4 W_k s_(k-1) + 2 (b_k - W_k 1))        y = 2 W_n s_(n-1) + b_n - W_n 1

so that h is nowhere computed. Its derivative 1 - h^2 is 4 s (1 - s). The derivatives of all of a
network's layers come from one node of PyTorch's graph.

What hidden layers pass on is written where that of an earlier minibatch stood: learning in
minibatches of 4096 takes 0.94 of the time that it takes with memory that is fresh from the system
(EPYC, in turns).
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import chain
from typing import Any

import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

_HALF_LOG_TAU = 0.5 * math.log(2.0 * math.pi)


class LeanMlpPolicy(ActorCriticPolicy):
    """`MlpPolicy` of PPO and A2C, with the same parameters and less to compute.

    Actions, values, likelihoods and derivatives are those of `ActorCriticPolicy` up to rounding:
    within 1e-5 of full scale. Its `state_dict` is the same, so that weights go from one to the
    other, and policy files are exported from it as from `MlpPolicy`. Actions are drawn with the
    same random numbers.

    What it leaves to `ActorCriticPolicy`, at that one's speed: networks that are anything but
    Linear layers with Tanh between them, actions that are not Gaussian, gSDE, autocast, what
    `torch.compile` compiles, and devices other than the processor. Derivatives are first ones only,
    and are not traced. It keeps the memory of two minibatches' hidden layers for the next ones:
    10 MB for two networks of two layers of 64, and minibatches of 4096.

    Example:
        >>> from stable_baselines3 import PPO
        >>> from pma_gym.envs.sb3 import SB3VecEnv
        >>> envs = SB3VecEnv(64, "displacement", pressure_kpa=300)
        >>> model = PPO(LeanMlpPolicy, envs, n_steps=64, batch_size=1024, device="cpu")
        >>> _ = model.learn(4096)
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 - the base class's
        super().__init__(*args, **kwargs)
        self._spares = _Spares()

    def forward(self, obs: Tensor, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Actions, values and logarithms of the actions' likelihoods; see `ActorCriticPolicy`."""
        if not self._is_lean():
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
        """Values, logarithms of the actions' likelihoods, and entropies; see the base class."""
        if not self._is_lean():
            return super().evaluate_actions(obs, actions)
        mean, values = self._mean_and_values(obs)
        entropy = (self.log_std + (0.5 + _HALF_LOG_TAU)).sum().expand(len(actions))
        return values, self._log_likelihood(actions, mean), entropy

    def _is_lean(self) -> bool:
        return (
            type(self.action_dist) is DiagGaussianDistribution
            and type(self.mlp_extractor) is MlpExtractor
            and self.log_std.device.type == "cpu"
            and not torch.is_autocast_enabled("cpu")
            and not torch.compiler.is_compiling()
            and all(_is_plain(modules) for modules in self._networks())
        )

    def _networks(self) -> tuple[list[nn.Module], list[nn.Module]]:
        """Modules of actor and critic, in order."""
        nets = self.mlp_extractor
        return [*nets.policy_net, self.action_net], [*nets.value_net, self.value_net]

    def _mean_and_values(self, obs: Any) -> tuple[Tensor, Tensor]:  # noqa: ANN401
        features = self.extract_features(obs)
        of_actor, of_critic = features if isinstance(features, tuple) else (features, features)
        actor, critic = self._networks()
        mean = _network(of_actor, actor, self._spares)
        if (mean + self.log_std).isnan().any():
            # It says what is wrong with them.
            self.action_dist.proba_distribution(mean, self.log_std)
        return mean, _network(of_critic, critic, self._spares)

    def _log_likelihood(self, actions: Tensor, mean: Tensor) -> Tensor:
        """Of the normal distribution, summed over an action's entries; shape (rows,)."""
        deviations = (actions - mean) * (-self.log_std).exp()
        constant = (self.log_std + _HALF_LOG_TAU).sum()
        return -0.5 * deviations.square().sum(dim=1) - constant


def _is_plain(modules: Sequence[nn.Module]) -> bool:
    """Whether they are Linear, Tanh and so on up to a Linear, with one hidden layer or more."""
    layers, between = modules[::2], modules[1::2]
    return (
        len(layers) == len(between) + 1 > 1
        and all(type(one) is nn.Tanh for one in between)
        and all(type(one) is nn.Linear and one.bias is not None for one in layers)
    )


def _network(x: Tensor, modules: Sequence[nn.Module], spares: "_Spares") -> Tensor:
    """What Linear layers with tanh between them say, the last without."""
    layers: Any = [(layer.weight, layer.bias) for layer in modules[::2]]
    if torch.is_grad_enabled():
        return _Network.apply(spares, x, *chain.from_iterable(layers))
    return _passed(x, layers, [None] * len(layers))[-1]


def _passed(
    x: Tensor, layers: Sequence[tuple[Tensor, Tensor]], out: Sequence[Tensor | None]
) -> list[Tensor]:
    """What every hidden layer passes on, its s, and y; written to `out` where that is given."""
    (weight, bias), *between, (last, last_bias) = layers
    first = torch.addmm(bias, x, weight.t(), beta=2, alpha=2, out=out[0])
    passed = [first.sigmoid_()]
    for (weight, bias), where in zip(between, out[1:], strict=False):
        shifted = bias - weight.sum(1)
        s = torch.addmm(shifted, passed[-1], weight.t(), beta=2, alpha=4, out=where)
        passed.append(s.sigmoid_())
    passed.append(torch.addmm(last_bias - last.sum(1), passed[-1], last.t(), alpha=2))
    return passed


class _Spares:
    """Matrices that nobody needs any more, to be written anew.

    PyTorch gives a minibatch's memory back to the system and gets it anew for the next: 150 to
    550 pages of 4 kB for 4096 rows, each of which the system clears when it is first touched.
    """

    def __init__(self) -> None:
        self._spare: deque[Tensor] = deque(maxlen=MOST_SPARES)

    def take(self, rows: int, columns: int, like: Tensor) -> Tensor:
        """A matrix of any contents, of the type of another."""
        for _ in range(len(self._spare)):
            try:
                found = self._spare.popleft()
            except IndexError:  # another thread took it
                break
            if found.shape == (rows, columns) and found.dtype is like.dtype:
                return found
            self._spare.append(found)
        return like.new_empty((rows, columns))

    def give(self, *matrices: Tensor) -> None:
        """Matrices that nobody else holds; the oldest are let go of where there are many."""
        self._spare.extend(matrices)

    def __reduce__(self) -> tuple[type["_Spares"], tuple[()]]:
        # A copy begins with none.
        return _Spares, ()


MOST_SPARES = 16
"""Matrices that a policy keeps: those of two minibatches, for an old one's graph is forgotten when
the next has been made, and of the derivatives, for two networks of two hidden layers."""


class _Lent:
    """Matrices that are spare again when the graph that holds this is forgotten."""

    def __init__(self, spares: _Spares, matrices: Sequence[Tensor]) -> None:
        self.spares, self.matrices = spares, matrices

    def __del__(self) -> None:
        self.spares.give(*self.matrices)


class _Network(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, spares: _Spares, x: Tensor, *parameters: Tensor) -> Tensor:  # noqa: ANN401
        layers = list(zip(parameters[::2], parameters[1::2], strict=True))
        out = [spares.take(len(x), len(weight), x) for weight, _ in layers[:-1]]
        *hidden, y = _passed(x, layers, [*out, None])
        # Not saved as the others are: PyTorch would let go of them, and could not say when.
        ctx.lent = _Lent(spares, hidden)
        ctx.save_for_backward(x, *parameters[::2])
        return y

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride] - by its decorator
        ctx: Any,  # noqa: ANN401
        *grad_outputs: Tensor,
    ) -> tuple[Tensor | None, ...]:
        (gradient,), (x, *weights) = grad_outputs, ctx.saved_tensors
        spares, hidden = ctx.lent.spares, ctx.lent.matrices
        gradients: list[Tensor] = []
        used = []
        for weight, s in zip(weights[:0:-1], hidden[::-1], strict=True):
            of_bias = gradient.sum(0)
            # By h = 2 s - 1.
            of_weight = torch.addmm(of_bias[:, None], gradient.t(), s, beta=-1, alpha=2)
            gradients += of_bias, of_weight
            used.append(spares.take(*s.shape, s))
            gradient = torch.mm(gradient, 4.0 * weight, out=used[-1])
            torch.ops.aten.sigmoid_backward.grad_input(gradient, s, grad_input=gradient)
        # So, and not the other way round: few columns on the left are four times as fast.
        gradients += gradient.sum(0), x.t().mm(gradient).t()
        of_x = gradient.mm(weights[0]) if ctx.needs_input_grad[1] else None
        spares.give(*used)
        return None, of_x, *gradients[::-1]
