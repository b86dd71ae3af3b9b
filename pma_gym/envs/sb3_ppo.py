"""Stable-Baselines3's PPO with less work in its minibatches on a processor."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.utils import explained_variance
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from pma_gym.envs.sb3_network import Derivatives, Layers, derivatives, layers_of, passed, scaled
from pma_gym.envs.sb3_policy import HALF_LOG_TAU, LeanMlpPolicy

Numbers = NDArray[np.float32]

Begin = Callable[..., Callable[[], Any]]
"""Begins a call; returns what waits for its result."""

MOST_ALONE = 1 << 22
"""Products of a number and a weight, in a network's pass, up to which a second thread is not worth
waking: 900 rows of two layers of 64 (EPYC). No bit of what is learned from a rollout depends on it.
"""


class LeanPPO(PPO):
    """PPO that learns from `LeanMlpPolicy` without PyTorch's graph, the critic in a second thread.

    It does what `PPO` does, minibatch by minibatch, in the same order of the same random numbers;
    what it has learned from one rollout is the same up to rounding. Its settings, its files and
    what it logs are those of `PPO`. "MlpPolicy" means `LeanMlpPolicy`.

    Derivatives are computed by the formulas of loss and layers and written to memory that all
    minibatches of a rollout share. Actor and critic share nothing but the limit of the gradient's
    norm: each learns in a thread of its own where PyTorch has two or more and minibatches are
    large. Each gets half of PyTorch's threads.

    What it leaves to `PPO`, at that one's speed: a policy that is no `LeanMlpPolicy`, or that
    leaves its own work to `ActorCriticPolicy`; feature extractors of one's own, and observations
    that are not flat; frozen parameters; and rollout buffers of other kinds.

    Example:
        >>> from pma_gym.envs.sb3 import SB3VecEnv
        >>> envs = SB3VecEnv(64, "displacement", pressure_kpa=300)
        >>> model = LeanPPO("MlpPolicy", envs, n_steps=64, batch_size=1024, device="cpu")
        >>> _ = model.learn(4096)
    """

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {
        **PPO.policy_aliases,
        "MlpPolicy": LeanMlpPolicy,
    }

    def is_lean(self) -> bool:
        """Whether it learns so, or as `PPO` does."""
        policy, space = self.policy, self.observation_space
        return (
            isinstance(policy, LeanMlpPolicy)
            and policy.is_lean()
            and type(policy.features_extractor) is FlattenExtractor
            and isinstance(space, spaces.Box)
            and len(space.shape) == 1
            and type(self.rollout_buffer) is RolloutBuffer
            and all(parameter.requires_grad for parameter in policy.parameters())
        )

    def _weights(self) -> int:
        """Of one of its networks, about."""
        return sum(parameter.numel() for parameter in self.policy.parameters()) // 2

    def collect_rollouts(self, env: VecEnv, *args: Any, **kwargs: Any) -> bool:  # noqa: ANN401
        """Collect a rollout; see `PPO.collect_rollouts`."""
        if not self.is_lean():
            return super().collect_rollouts(env, *args, **kwargs)
        assert isinstance(self.policy, LeanMlpPolicy)
        # Threads that have few rows each only wait for each other.
        few = env.num_envs * self._weights() <= MOST_ALONE
        with self.policy.held(), _threads(1 if few else torch.get_num_threads()):
            return super().collect_rollouts(env, *args, **kwargs)

    def train(self) -> None:
        """Learn from the rollout; see `PPO.train`."""
        if not self.is_lean():
            super().train()
            return
        assert isinstance(self.policy, LeanMlpPolicy)
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        remaining = self._current_progress_remaining
        clip: Any = self.clip_range
        clip_values: Any = self.clip_range_vf
        clips = clip(remaining), None if clip_values is None else clip_values(remaining)
        with torch.no_grad():
            # Numbers that are too large become infinite, as in PyTorch.
            with np.errstate(over="ignore", invalid="ignore"):
                self._log(self._learn_from(self.policy, *clips), *clips)

    def _learn_from(
        self, policy: LeanMlpPolicy, clip: float, clip_values: float | None
    ) -> "_Losses":
        """Go through the rollout `n_epochs` times, or until the policy has changed too much."""
        rollout = _Rollout(self.rollout_buffer, self.normalize_advantage)
        most = min(self.batch_size, rollout.rows)
        updates, losses = _Updates(policy, most), _Losses()
        with _two_at_once(most * self._weights()) as begin:
            for epoch in range(self.n_epochs):
                losses.divergences.clear()
                acted: list[_Acted] = []
                order = np.random.permutation(rollout.rows)
                rows = [order[i : i + most] for i in range(0, rollout.rows, most)]
                waiting = begin(rollout.part, rows[0])
                for following in [*rows[1:], None]:
                    part = waiting()
                    critic = begin(self._criticise, updates.critic, part, clip_values)
                    if following is not None:
                        # Behind the critic, while the optimiser works.
                        waiting = begin(rollout.part, following)
                    acted.append(self._act(updates, part, clip))
                    losses.values.append(critic())
                    if self.target_kl is not None:
                        losses.judge(acted.pop(), clip)
                        divergence = losses.divergences[-1]
                        if divergence > 1.5 * self.target_kl:
                            self._n_updates += 1
                            if self.verbose >= 1:
                                print(
                                    f"Early stopping at step {epoch} due to reaching max kl: "
                                    f"{divergence:.2f}"
                                )
                            return losses
                    updates.make(self.max_grad_norm)
                # Not in between, where Python's threads wait for each other.
                for one in acted:
                    losses.judge(one, clip)
                self._n_updates += 1
        return losses

    def _act(self, updates: "_Updates", part: "_Part", clip: float) -> "_Acted":
        """The actor's derivatives, and what its losses follow from."""
        mean = updates.actor.passed(part.observations)
        updates.policy.check_mean(mean)
        log_std = updates.log_std
        deviations = (part.actions - mean.numpy()) * np.exp(-log_std)
        squares = np.square(deviations)
        constant = (log_std + HALF_LOG_TAU).sum()
        log_ratio = -0.5 * squares.sum(1) - constant - part.likelihoods
        ratio = np.exp(log_ratio)
        free = part.advantages * ratio
        clipped = part.advantages * np.clip(ratio, 1.0 - clip, 1.0 + clip)
        # By the logarithm of the likelihood; none where the clipped ratio counts.
        by_likelihood = (np.where(free > clipped, 0.0, free) / -len(free))[:, None]
        updates.of_log_std[:] = (by_likelihood * (squares - 1.0)).sum(0) - self.ent_coef
        by_mean = by_likelihood * deviations * np.exp(-log_std)
        updates.actor.derive(torch.from_numpy(by_mean), part.observations)
        return _Acted(log_std.copy(), log_ratio, ratio, free, clipped)

    def _criticise(self, critic: "_Net", part: "_Part", clip: float | None) -> float:
        """The critic's derivatives; its loss."""
        values = critic.passed(part.observations).numpy()[:, 0]
        errors = by_value = values - part.returns
        if clip is not None:
            changes = values - part.values
            errors = part.values + np.clip(changes, -clip, clip) - part.returns
            by_value = np.where(np.abs(changes) > clip, 0.0, errors)
        by_value = by_value * (2.0 * self.vf_coef / len(values))
        critic.derive(torch.from_numpy(by_value[:, None]), part.observations)
        return float(np.square(errors).mean())

    def _log(self, losses: "_Losses", clip: float, clip_values: float | None) -> None:
        buffer, record = self.rollout_buffer, self.logger.record
        policy, value, entropy = losses.policies[-1], losses.values[-1], losses.entropies[-1]
        record("train/entropy_loss", np.mean(losses.entropies))
        record("train/policy_gradient_loss", np.mean(losses.policies))
        record("train/value_loss", np.mean(losses.values))
        record("train/approx_kl", np.mean(losses.divergences))
        record("train/clip_fraction", np.mean(losses.clipped))
        record("train/loss", policy + self.ent_coef * entropy + self.vf_coef * value)
        explained = explained_variance(buffer.values.flatten(), buffer.returns.flatten())
        record("train/explained_variance", explained)
        record("train/std", float(self.policy.log_std.exp().mean()))
        record("train/n_updates", self._n_updates, exclude="tensorboard")
        record("train/clip_range", clip)
        if clip_values is not None:
            record("train/clip_range_vf", clip_values)


@dataclass(frozen=True)
class _Part:
    """Steps of a rollout.

    Attributes:
        observations: shape (rows, entries).
        actions: shape (rows, entries).
        likelihoods: logarithms of those of the actions when they were drawn; shape (rows,).
        advantages, values, returns: shape (rows,).
    """

    observations: Tensor
    actions: Numbers
    likelihoods: Numbers
    advantages: Numbers
    values: Numbers
    returns: Numbers


@dataclass(frozen=True)
class _Acted:
    """What the actor's losses in a minibatch follow from.

    Attributes:
        log_std: logarithms of the actions' standard deviations, shape (entries,).
        log_ratio, ratio: of the actions' likelihood now to that when they were drawn,
            shape (rows,).
        free, clipped: advantages times the ratio, and times the clipped one, shape (rows,).
    """

    log_std: Numbers
    log_ratio: Numbers
    ratio: Numbers
    free: Numbers
    clipped: Numbers


class _Rollout:
    """What a buffer holds, a row a step, all of a step side by side.

    Args:
        buffer: the buffer.
        normalises: advantages of a minibatch get a mean of 0 and a standard deviation of 1.
    """

    def __init__(self, buffer: RolloutBuffer, normalises: bool) -> None:
        self._normalises = normalises
        self.rows = buffer.buffer_size * buffer.n_envs
        names = "observations", "actions", "log_probs", "advantages", "values", "returns"
        # The order of the buffer's own samples, in which it keeps what it has drawn from.
        order = (lambda whole: whole) if buffer.generator_ready else buffer.swap_and_flatten
        columns = [order(getattr(buffer, name)).reshape(self.rows, -1) for name in names]
        self._entries = columns[0].shape[1]
        self._whole = np.concatenate(columns, axis=1, dtype=np.float32)

    def part(self, rows: NDArray[np.int64]) -> _Part:
        found = self._whole.take(rows, 0)
        observations, actions = found[:, : self._entries], found[:, self._entries : -4]
        likelihoods, advantages, *others = found[:, -4:].T
        if self._normalises and len(rows) > 1:
            advantages = (advantages - advantages.mean()) / (advantages.std(ddof=1) + 1e-8)
        return _Part(torch.from_numpy(observations), actions, likelihoods, advantages, *others)


class _Net:
    """A network, with memory for a minibatch's pass and derivatives."""

    def __init__(self, layers: Layers, most: int) -> None:
        self._layers = layers
        self.weights = [weight for weight, _ in layers]
        self.follow()
        self._memory = [
            [weight.new_empty((most, len(weight))) for weight in self.weights[:-1]]
            for _ in range(2)
        ]
        self._gradients = [(_gradient(weight), _gradient(bias)) for weight, bias in layers]
        self._hidden: list[Tensor] = []

    def follow(self) -> None:
        """What follows from the parameters, once they have changed."""
        self._scaled = scaled(self._layers)

    def passed(self, seen: Tensor) -> Tensor:
        out = [one[: len(seen)] for one in self._memory[0]]
        *self._hidden, y = passed(seen, self._scaled, out)
        return y

    def derive(self, of_y: Tensor, seen: Tensor) -> None:
        places = [one[: len(seen)] for one in self._memory[1]]
        out = Derivatives(self._gradients, places)
        derivatives(of_y, seen, self.weights, self._hidden, out)


def _gradient(parameter: Tensor) -> Tensor:
    assert parameter.grad is not None
    return parameter.grad


class _Updates:
    """The policy's networks, its derivatives in one piece of memory, and its optimiser."""

    def __init__(self, policy: LeanMlpPolicy, most: int) -> None:
        self.policy = policy
        self.log_std = policy.log_std.detach().numpy()
        parameters = list(policy.parameters())
        self._gradient = parameters[0].new_zeros(sum(one.numel() for one in parameters))
        pieces = self._gradient.split([one.numel() for one in parameters])
        for parameter, piece in zip(parameters, pieces, strict=True):
            parameter.grad = piece.view_as(parameter)
        self.of_log_std = _gradient(policy.log_std).numpy()
        actor, critic = policy.networks()
        self.actor, self.critic = _Net(layers_of(actor), most), _Net(layers_of(critic), most)

    def make(self, most: float) -> None:
        """An update, by derivatives whose norm is limited."""
        self._gradient.mul_((most / (self._gradient.norm() + 1e-6)).clamp(max=1.0))
        self.policy.optimizer.step()
        # Here, where no other thread of Python's works, for small operations wait for each other.
        self.actor.follow()
        self.critic.follow()


class _Losses:
    """Of minibatches."""

    def __init__(self) -> None:
        self.policies: list[float] = []
        self.values: list[float] = []
        self.entropies: list[float] = []
        self.clipped: list[float] = []
        self.divergences: list[float] = []

    def judge(self, acted: _Acted, clip: float) -> None:
        """Add the actor's losses of a minibatch."""
        ratio, log_ratio = acted.ratio, acted.log_ratio
        self.policies.append(-float(np.minimum(acted.free, acted.clipped).mean()))
        self.clipped.append(float((np.abs(ratio - 1.0) > clip).mean()))
        self.entropies.append(-float((acted.log_std + (0.5 + HALF_LOG_TAU)).sum()))
        self.divergences.append(float((ratio - 1.0 - log_ratio).mean()))


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """PyTorch has so many threads meanwhile."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def _two_at_once(work: int) -> Iterator[Begin]:
    """What begins calls in a second thread.

    Args:
        work: products in a network's pass. Where they are few, or PyTorch has one thread, what is
            begun is done at once.
    """
    threads = torch.get_num_threads()
    if threads == 1 or work <= MOST_ALONE:
        with _threads(1):
            yield lambda call, *arguments: _result(torch.no_grad()(call)(*arguments))
        return
    each = threads // 2
    with ThreadPoolExecutor(1, "pma_gym critic", torch.set_num_threads, (each,)) as pool:
        with _threads(each):
            yield lambda call, *arguments: pool.submit(torch.no_grad()(call), *arguments).result


def _result(found: object) -> Callable[[], Any]:
    return lambda: found
