"""Registered ids in place of task names, for a batch made without `gym.make_vec`."""

import importlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeGuard

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, load_env_creator

from pma_gym.envs.pma_env import PMAEnv
from pma_gym.envs.vector import PMAVectorEnv

OURS = (PMAEnv, PMAVectorEnv)


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
    points = [point for point in (spec.vector_entry_point, spec.entry_point) if point is not None]
    made = [load_env_creator(point) if isinstance(point, str) else point for point in points[:1]]
    return not spec.additional_wrappers and any(one in OURS for one in made)
