"""Stable-Baselines3's PPO with less work in its minibatches on a processor.

Choice between one and two threads for repeated work, by recent times.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from itertools import chain
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

from pma_gym.sb3.network import (
    Derivatives,
    Layers,
    alike,
    derivatives,
    passed,
    scaled,
    side_by_side,
)
from pma_gym.sb3.policy import HALF_LOG_TAU, LeanMlpPolicy

FIRST = 3
"""Repetitions that a single thread does first, to measure its time."""

PATIENCE = 2.0
"""Loss of two threads against one from which they pause: in times of one thread."""

PAUSES_S = (0.5, 8.0)
"""The shortest and the longest pause until two threads are tried again."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Set the number of PyTorch's threads inside the context."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class ThreadTuner:
    """Chooses the number of threads by the time that the work has taken.

    PyTorch's threads wait for each other many times in a minibatch. Where another program wants a
    core too, they often wait for its whole time slice: of two trainings at once on two cores
    (Xeon), with two threads each, each took 5 times as long as a single training with minibatches
    of 4096, and more than 50 times with 1024. So two threads stop as soon as they have lost more
    than `PATIENCE`, and start again after a pause, which doubles while they go on losing.

    It is for work whose result does not depend on the number of threads.
    """

    def __init__(self) -> None:
        self._alone: list[float] = []
        self._lost = 0.0
        self._pause_s = PAUSES_S[0]
        self._since = self._until = -math.inf

    @contextmanager
    def work(self, amount: float) -> Iterator[None]:
        """Time an amount of work (any unit) inside the context, with the chosen threads."""
        start = time.perf_counter()
        count = 2 if len(self._alone) >= FIRST and start >= self._until else 1
        with threads(count):
            yield
        end = time.perf_counter()
        taken = (end - start) / amount
        if count == 1:
            # The latest ones, for what one thread takes is another thing beside another program.
            self._alone = [*self._alone[1 - FIRST :], taken]
            self._since = end
            return
        self._lost = max(0.0, self._lost + taken / min(self._alone) - 1.0)
        if self._lost > PATIENCE:
            # Where they have gone well for long, it is another disturbance.
            if start - self._since > 4.0 * self._pause_s:
                self._pause_s = PAUSES_S[0]
            self._until, self._lost = end + self._pause_s, 0.0
            self._pause_s = min(2.0 * self._pause_s, PAUSES_S[1])


Numbers = NDArray[np.floating]

MOST_ALONE = 1 << 22
"""Products of a number and a weight, in a network's pass, up to which a second thread is not worth
waking: 900 rows of two layers of 64. No bit of what is learned from a rollout depends on it.
"""


class LeanPPO(PPO):
    """PPO that learns from `LeanMlpPolicy` without PyTorch's graph, actor and critic side by side.

    It does what `PPO` does, minibatch by minibatch, in the same order of the same random numbers;
    what it has learned from one rollout is the same up to rounding. Its settings, its files and
    what it logs are those of `PPO`. "MlpPolicy" means `LeanMlpPolicy`. Trainings of 5 million steps
    by the preset of the shipped displacement policy came to the same errors in 0.57 to 0.66 of the
    processor time of `PPO` (three seeds, docs/notebook/speed.md).

    Derivatives are computed by the formulas of loss and layers and written to memory that all
    minibatches of a rollout share. Where PyTorch has two threads or more and minibatches are large,
    actor and critic get a thread each, if their layers have the same shapes, and while that is
    faster, which it is not where another program wants the cores; no bit depends on it.

    What it leaves to `PPO`, at that one's speed: a policy that is no `LeanMlpPolicy`, or that
    leaves its own work to `ActorCriticPolicy`; feature extractors of one's own, and observations
    that are not flat; frozen parameters; and rollout buffers of other kinds.

    Example:
        >>> from pma_gym.sb3.vec_env import SB3VecEnv
        >>> envs = SB3VecEnv(64, "displacement", pressure_kpa=300)
        >>> model = LeanPPO("MlpPolicy", envs, n_steps=64, batch_size=1024, device="cpu")
        >>> _ = model.learn(4096)
    """

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {
        **PPO.policy_aliases,
        "MlpPolicy": LeanMlpPolicy,
    }

    def _setup_model(self) -> None:
        super()._setup_model()
        self._thread_tuner = ThreadTuner()

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_thread_tuner"]

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
        with self.policy.held(), threads(1 if few else torch.get_num_threads()):
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
        updates, losses = _Updates(policy), _Losses()
        large = most * self._weights() > MOST_ALONE and torch.get_num_threads() > 1
        pace = self._thread_tuner.work if large and updates.are_together else nullcontext
        with threads(1):
            for epoch in range(self.n_epochs):
                losses.divergences.clear()
                order = np.random.permutation(rollout.rows)
                for start in range(0, rollout.rows, most):
                    rows = order[start : start + most]
                    with pace(len(rows)):
                        part = rollout.part(rows)
                        grad_output = self._derivatives(updates, part, clip, clip_values, losses)
                        if self._has_changed_too_much(losses.divergences[-1], epoch):
                            self._n_updates += 1
                            return losses
                        updates.make(grad_output, part.observations, self.max_grad_norm)
                self._n_updates += 1
        return losses

    def _derivatives(
        self,
        updates: "_Updates",
        part: "_Part",
        clip: float,
        clip_values: float | None,
        losses: "_Losses",
    ) -> Sequence[Numbers]:
        """Return derivatives of the losses by the outputs of actor and critic, (rows, outputs)."""
        mean, values = updates.passed(part.observations)
        updates.policy.check_mean(mean)
        by_mean = self._act(updates, part, mean.numpy(), clip, losses)
        return by_mean, self._criticise(part, values.numpy()[:, 0], clip_values, losses)

    def _has_changed_too_much(self, divergence: float, epoch: int) -> bool:
        stops = self.target_kl is not None and divergence > 1.5 * self.target_kl
        if stops and self.verbose >= 1:
            print(f"Early stopping at step {epoch} due to reaching max kl: {divergence:.2f}")
        return stops

    def _act(
        self, updates: "_Updates", part: "_Part", mean: Numbers, clip: float, losses: "_Losses"
    ) -> Numbers:
        """Return derivatives of the actor's loss by the means; write those by `log_std`."""
        log_std = updates.log_std
        deviations = (part.actions - mean) * np.exp(-log_std)
        squares = np.square(deviations)
        constant = (log_std + HALF_LOG_TAU).sum()
        log_ratio = -0.5 * squares.sum(1) - constant - part.likelihoods
        ratio = np.exp(log_ratio)
        free = part.advantages * ratio
        clipped = part.advantages * np.clip(ratio, 1.0 - clip, 1.0 + clip)
        losses.policies.append(-float(np.minimum(free, clipped).mean()))
        losses.clipped.append(float((np.abs(ratio - 1.0) > clip).mean()))
        losses.entropies.append(-float((log_std + (0.5 + HALF_LOG_TAU)).sum()))
        losses.divergences.append(float((ratio - 1.0 - log_ratio).mean()))
        # By the logarithm of the likelihood; none where the clipped ratio counts.
        by_likelihood = (np.where(free > clipped, 0.0, free) / -len(free))[:, None]
        updates.of_log_std[:] = (by_likelihood * (squares - 1.0)).sum(0) - self.ent_coef
        return by_likelihood * deviations * np.exp(-log_std)

    def _criticise(
        self, part: "_Part", values: Numbers, clip: float | None, losses: "_Losses"
    ) -> Numbers:
        """Return derivatives of the critic's loss by the values; shape (rows, 1)."""
        errors = by_value = values - part.returns
        if clip is not None:
            changes = values - part.values
            errors = part.values + np.clip(changes, -clip, clip) - part.returns
            by_value = np.where(np.abs(changes) > clip, 0.0, errors)
        losses.values.append(float(np.square(errors).mean()))
        return by_value[:, None] * (2.0 * self.vf_coef / len(values))

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


class _Rollout:
    """Contents of a buffer as a table with a row for each step.

    Args:
        buffer: the buffer.
        normalises: whether advantages of a minibatch get mean 0 and standard deviation 1.
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
        table = self._whole.take(rows, 0)
        observations, actions = table[:, : self._entries], table[:, self._entries : -4]
        likelihoods, advantages, *others = table[:, -4:].T
        if self._normalises and len(rows) > 1:
            advantages = (advantages - advantages.mean()) / (advantages.std(ddof=1) + 1e-8)
        return _Part(torch.from_numpy(observations), actions, likelihoods, advantages, *others)


class _Group:
    """Stacked networks with memory for a minibatch's forward pass and derivatives.

    Args:
        nets: networks of equal shapes.
    """

    def __init__(self, nets: Sequence[Layers]) -> None:
        self._nets, self.count = nets, len(nets)
        self.follow()
        self._memory: dict[int, list[list[Tensor]]] = {}
        self._hidden: list[Tensor] = []
        self._gradients: Layers = []

    def shapes(self) -> list[torch.Size]:
        """Return shapes of weights and biases, layer after layer."""
        return [shape for one in self._weights for shape in (one.shape, one.shape[:-1])]

    def take(self, gradients: Sequence[Tensor]) -> None:
        """Write derivatives into these tensors (of `shapes`); parameters get them as `grad`."""
        self._gradients = list(zip(gradients[::2], gradients[1::2], strict=True))
        parameters = [chain.from_iterable(layers) for layers in self._nets]
        for of_nets, pieces in zip(zip(*parameters, strict=True), gradients, strict=True):
            for parameter, piece in zip(of_nets, self._each(pieces), strict=True):
                parameter.grad = piece

    def follow(self) -> None:
        """Update stacked and scaled layers after the parameters have changed."""
        layers = side_by_side(self._nets)
        self._weights = [weight for weight, _ in layers]
        self._scaled = scaled(layers)

    def passed(self, seen: Tensor) -> Sequence[Tensor]:
        *self._hidden, y = passed(seen, self._scaled, self._buffers(len(seen))[0])
        return self._each(y)

    def backward(self, grad_output: Sequence[Tensor], seen: Tensor) -> None:
        together = grad_output[0] if self.count == 1 else torch.stack(list(grad_output))
        out = Derivatives(self._gradients, self._buffers(len(seen))[1])
        derivatives(together, seen, self._weights, self._hidden, out)

    def _each(self, together: Tensor) -> Sequence[Tensor]:
        return [together] if self.count == 1 else list(together)

    def _buffers(self, rows: int) -> list[list[Tensor]]:
        """Return memory for outputs of hidden layers, and for derivatives by them."""
        if rows not in self._memory:
            hidden = [weight[..., 0] for weight in self._weights[:-1]]
            shapes = [(*one.shape[:-1], rows, one.shape[-1]) for one in hidden]
            both = [[hidden[0].new_empty(shape) for shape in shapes] for _ in range(2)]
            self._memory[rows] = both
        return self._memory[rows]


class _Updates:
    """The policy's networks, its derivatives in one piece of memory, and its optimiser."""

    def __init__(self, policy: LeanMlpPolicy) -> None:
        self.policy = policy
        self.log_std = policy.log_std.detach().numpy()
        self._groups = [_Group(nets) for nets in alike(policy.layers())]
        shapes = [policy.log_std.shape, *(one for group in self._groups for one in group.shapes())]
        sizes = [math.prod(shape) for shape in shapes]
        self._gradient = policy.log_std.new_zeros(sum(sizes))
        both = zip(self._gradient.split(sizes), shapes, strict=True)
        policy.log_std.grad, *others = (piece.view(shape) for piece, shape in both)
        self.of_log_std = policy.log_std.grad.numpy()
        for group in self._groups:
            count = len(group.shapes())
            group.take(others[:count])
            del others[:count]

    @property
    def are_together(self) -> bool:
        """Whether actor and critic form one group."""
        return len(self._groups) == 1

    def passed(self, seen: Tensor) -> list[Tensor]:
        """Return the outputs of actor and critic; shapes (rows, outputs)."""
        return [y for group in self._groups for y in group.passed(seen)]

    def make(self, grad_output: Sequence[Numbers], seen: Tensor, most: float) -> None:
        """Update the parameters by derivatives whose norm is limited.

        Args:
            grad_output: derivatives of the losses by the outputs of actor and critic.
            seen: the observations of these outputs.
            most: limit of the norm.
        """
        left = [torch.from_numpy(one) for one in grad_output]
        for group in self._groups:
            group.backward(left[: group.count], seen)
            del left[: group.count]
        self._gradient.mul_((most / (self._gradient.norm() + 1e-6)).clamp(max=1.0))
        self.policy.optimizer.step()
        for group in self._groups:
            group.follow()


class _Losses:
    """Losses and statistics of minibatches."""

    def __init__(self) -> None:
        self.policies: list[float] = []
        self.values: list[float] = []
        self.entropies: list[float] = []
        self.clipped: list[float] = []
        self.divergences: list[float] = []
