"""Batched environments as Stable-Baselines3's VecEnv; needs the extra `rl`.

Registered ids in place of task names, for a batch made without `gym.make_vec`.
"""

import importlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any, TypeGuard

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec, load_env_creator
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pma_gym.engine.option_checks import check_known, parse_pressure
from pma_gym.envs.member import TOGETHER, BatchMember, refusal
from pma_gym.envs.pma_env import PMAEnv
from pma_gym.envs.rig_env import RigEnv, RigVectorEnv
from pma_gym.envs.summary import last_info
from pma_gym.envs.vector import PMAVectorEnv
from pma_gym.tasks import Task

OURS = (PMAEnv, PMAVectorEnv, RigEnv, RigVectorEnv)


def is_id(task: object) -> TypeGuard[str]:
    """Whether a task is a registered environment's id and not a task's name.

    >>> [is_id(name) for name in ("displacement", "pma_gym/IsokineticRotation-v0")]
    [False, True]
    """
    return isinstance(task, str) and ("/" in task or ":" in task or task in gym.registry)


def registered(task: str, options: Mapping[str, Any]) -> tuple[EnvSpec, dict[str, Any]]:
    """Return the spec and the keyword arguments of a registered id.

    Args:
        task: the id, with or without the module that registers it: `pma_gym:pma_gym/Name-v0`.
        options: options that replace or add to the registered ones.
    Raises:
        gymnasium.error.Error: an unknown id.
        ModuleNotFoundError: the module in front of the id cannot be imported.
        ValueError: an id of an environment that is not a `PMAEnv`.
    """
    module, _, name = task.rpartition(":")
    if module:
        importlib.import_module(module)
    spec = gym.spec(name)
    if not _is_ours(spec):
        raise ValueError(
            f"{name} is not an environment of pma_gym, but {spec.entry_point}; make it with "
            "stable_baselines3.common.env_util.make_vec_env"
        )
    limit = {} if spec.max_episode_steps is None else {"max_episode_steps": spec.max_episode_steps}
    merged = {**limit, **spec.kwargs, **options}
    return replace(spec, kwargs=dict(merged)), merged


def _is_ours(spec: EnvSpec) -> bool:
    return not spec.additional_wrappers and _entry(spec) in OURS


def _entry(spec: EnvSpec) -> Any:  # noqa: ANN401 - whatever was registered
    points = [point for point in (spec.vector_entry_point, spec.entry_point) if point is not None]
    point = points[0] if points else None
    return load_env_creator(point) if isinstance(point, str) else point


try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import (
        VecEnvIndices,
        VecEnvObs,
        VecEnvStepReturn,
    )
except ModuleNotFoundError as error:
    missing = str(error.name).partition(".")[0]
    raise ModuleNotFoundError(
        f'pma_gym.sb3 needs {missing}, which is not installed: pip install "pma-gym[rl]"',
        name=missing,
    ) from None


class EngineVecEnv(VecEnv):
    """Base of VecEnvs around a `PMAVectorEnv`, whose environments share one engine.

    Attributes:
        envs: the PMAVectorEnv.
        together: names of methods that one environment cannot do without the others.
    """

    envs: PMAVectorEnv
    together: tuple[str, ...] = ("step", "reset")

    def close(self) -> None:
        """Free the environments."""
        self.envs.close()

    def _members(self, indices: VecEnvIndices) -> list[BatchMember]:
        """The environments that are asked for: all, one by its number, or some."""
        chosen = [indices] if isinstance(indices, Integral) else indices
        numbers = range(self.num_envs) if chosen is None else chosen
        return [self.envs.member(int(i)) for i in numbers]  # type: ignore[union-attr]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each environment, as `PMAEnv` has it."""
        return [self._read(member, attr_name) for member in self._members(indices)]

    def _read(self, member: BatchMember, name: str) -> Any:  # noqa: ANN401 - an attribute
        try:
            return getattr(member, name)
        except AttributeError as error:
            if hasattr(BatchMember, name) or not hasattr(self.envs, name):
                raise
            raise AttributeError(
                f"one environment of the batch has no {name!r}, only the whole batch has: read "
                f"it from the attribute envs of the {type(self).__name__}, .envs.{name}"
            ) from error

    def set_attr(
        self,
        attr_name: str,
        value: Any,  # noqa: ANN401 - as the base class has it
        indices: VecEnvIndices = None,
    ) -> None:
        """Set `pressure_kpa` of the later episodes; environments that share an engine have no more.

        Raises:
            AttributeError: another attribute; says what can be done instead.
            ValueError: a pressure out of range, as of the option.
        """
        if attr_name not in SETTABLE:
            raise AttributeError(refusal(attr_name))
        pressure = parse_pressure(value, self.envs.engine.nominal_model)
        self.envs.set_pressures({one.index: pressure for one in self._members(indices)})

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of each environment asked for, as `PMAEnv` has it.

        Raises:
            RuntimeError: a method that the environments of the batch can only do together.
        """
        if method_name in self.together:
            raise RuntimeError(
                f"{method_name}() cannot be called for single environments: {TOGETHER}; call "
                f"{method_name}() of the {type(self).__name__}"
            )
        methods = [self._read(member, method_name) for member in self._members(indices)]
        return [method(*method_args, **method_kwargs) for method in methods]

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """Return True for Monitor, whose `episode` the infos hold, and False for other wrappers."""
        return [wrapper_class is Monitor for _ in self._members(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return a picture of each environment, or None without a render mode."""
        return self.envs.render() or [None] * self.num_envs


SETTABLE = ("pressure_kpa",)
"""What `SB3VecEnv.set_attr` sets: environments that share an engine share everything else."""


class SB3VecEnv(EngineVecEnv):
    """`PMAVectorEnv` as a VecEnv, for training with Stable-Baselines3.

    An environment's info is empty but where its episode ends. There it has `PMAEnv`'s last info,
    `terminal_observation`, `TimeLimit.truncated`, and `episode` as Monitor writes it (return r,
    length l, time t).

    Args:
        num_envs: how many environments.
        task: name of a task, or a Task, as `PMAEnv`; or the id of a registered environment, whose
            own options those given here are added to.
        options: as `PMAVectorEnv`, but for the autoreset mode, which is SAME_STEP.

    Attributes:
        envs: the PMAVectorEnv; its own `step` tells of episodes that end as an info here does.

    Example:
        >>> from stable_baselines3 import PPO
        >>> envs = SB3VecEnv(64, "displacement", pressure_kpa=300)
        >>> model = PPO("MlpPolicy", envs, n_steps=64, batch_size=1024, device="cpu")
        >>> _ = model.learn(4096)
    """

    together = ("step",)
    spec: EnvSpec | None = None

    def __init__(self, num_envs: int, task: str | Task = "displacement", **options: Any) -> None:
        """Make the environments."""
        check_known("option", [name for name in options if name == "autoreset_mode"], ())
        batch = self._batch()
        if is_id(task):
            self.spec, options = registered(task, options)
            if _entry(self.spec) in (RigEnv, RigVectorEnv):
                batch = _RigBatch
            task = options.pop("task", None if batch is _RigBatch else "displacement")
        self.envs = batch(num_envs, task, autoreset_mode=AutoresetMode.SAME_STEP, **options)
        self.envs.spec = self.spec
        super().__init__(
            num_envs, self.envs.single_observation_space, self.envs.single_action_space
        )
        # A recorded video plays in real time.
        self.metadata = self.metadata | {"render_fps": self.envs.metadata["render_fps"]}
        self._actions = np.zeros(self.envs.action_space.shape or (), np.float32)
        self._nothing: list[dict[str, Any]] = [{} for _ in range(num_envs)]
        self._returns = np.zeros(num_envs)
        self._lengths = np.zeros(num_envs, np.int64)
        self._made = time.time()

    def _batch(self) -> "type[_InfosByNumber]":
        return _Batch

    def reset(self) -> VecEnvObs:
        """Begin an episode in every environment, with the values of `seed` and `set_options`."""
        options = {"pressures_kpa": self._pressures()} if any(self._options) else None
        observations, _ = self.envs.reset(seed=self._seeds, options=options)
        self._returns[:], self._lengths[:] = 0.0, 0
        self._reset_seeds()
        self._reset_options()
        return observations

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of each environment asked for, as `PMAEnv` has it; `reset` too."""
        results = super().env_method(method_name, *method_args, indices=indices, **method_kwargs)
        if method_name == "reset":
            restarted = [member.index for member in self._members(indices)]
            self._returns[restarted], self._lengths[restarted] = 0.0, 0
        return results

    def _pressures(self) -> list[Any]:
        for options in self._options:
            check_known("reset option", options, ("pressure_kpa",))
        usual = self.envs.engine.wanted
        pairs = zip(self._options, usual, strict=True)
        return [options.get("pressure_kpa", pressure) for options, pressure in pairs]

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step; an environment whose episode ends returns the next one's first observation."""
        observations, rewards, terminated, truncated, last = self.envs.step(self._actions)
        ended: dict[Any, dict[str, Any]] = last
        over = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        # The same empty dictionaries in every step, but for those that someone wrote to: making
        # them takes a fifth of the time of a step.
        if any(self._nothing):
            self._nothing = [one if not one else {} for one in self._nothing]
        infos = self._nothing.copy()
        for i, info in ended.items():
            info["TimeLimit.truncated"] = not terminated[i]
            info["episode"] = {
                "r": float(self._returns[i]),
                "l": int(self._lengths[i]),
                "t": round(time.time() - self._made, 6),
            }
            infos[i] = info
            self._returns[i], self._lengths[i] = 0.0, 0
        return observations, rewards.astype(np.float32), over, infos


class SB3RigVecEnv(SB3VecEnv):
    """`RigVectorEnv` as a VecEnv: tasks and options are those of `RigEnv`."""

    def _batch(self) -> "type[_InfosByNumber]":
        return _RigBatch


class _InfosByNumber(PMAVectorEnv):
    """Tells of episodes that end by the number of their environment, each as SB3 has an info."""

    def _final(self, over: NDArray[np.bool_], indices: NDArray[np.int64]) -> dict[Any, Any]:
        observed = self.engine.observations
        return {
            i: last_info(self.engine, i) | {"terminal_observation": observed[i].copy()}
            for i in indices.tolist()
        }


class _Batch(_InfosByNumber):
    """A batch of a station."""


class _RigBatch(_InfosByNumber, RigVectorEnv):
    """A batch of any rig."""
