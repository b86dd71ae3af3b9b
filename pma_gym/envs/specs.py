"""Gymnasium's specs of the environments: the number of steps, and arguments for JSON.

`gym.make` adds a TimeLimit wrapper with the registered number of steps. The environments truncate
episodes on their own, after a number of steps that depends on the options, so this wrapper would
shorten episodes. `own_time_limit` removes it. A number of steps from the user becomes the
environment's limit.
"""

from dataclasses import replace
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, WrapperSpec

from pma_gym.engine.option_checks import plain_options
from pma_gym.engine.options import DefaultSteps


class SingleEnvWrappers(tuple[WrapperSpec, ...]):
    """Wrappers that `gym.make` applies and `gym.make_vec` ignores.

    `make` iterates over them. `make_vec` rejects ids with wrappers, by their number; but a batch
    has its own limit and needs none of these, so the number is 0.
    """

    def __len__(self) -> int:
        """Return 0: a batch needs no wrappers."""
        return 0


def single_wrappers(steps: int) -> SingleEnvWrappers:
    """Return the wrappers of a spec with a number of steps."""
    default = {"default": DefaultSteps(steps)}
    return SingleEnvWrappers(
        (WrapperSpec("own_time_limit", f"{__name__}:own_time_limit", default),)
    )


def own_time_limit(env: gym.Env[Any, Any], default: int) -> gym.Env[Any, Any]:
    """Replace the TimeLimit around an environment by the environment's own limit.

    `gym.make` calls it like a wrapper.

    Args:
        env: environment that `gym.make` has made so far.
        default: number of steps from the spec's options. Its type is DefaultSteps, except in a spec
            from JSON, where only the value distinguishes it from a user's number.
    """
    inner: Any = env.unwrapped
    own = inner.horizon
    if isinstance(env, gym.wrappers.TimeLimit):
        steps = env._max_episode_steps
        known = isinstance(default, DefaultSteps)
        if not isinstance(steps, DefaultSteps) and (known or steps != default):
            inner.limit_steps(steps)
            inner.spec = replace(inner.spec, max_episode_steps=inner.horizon)
        env = env.env
    inner.spec = replace(inner.spec, additional_wrappers=single_wrappers(own))
    return env


def completed_spec(spec: EnvSpec | None, horizon: int) -> EnvSpec | None:
    """Return a spec with JSON arguments and the true number of steps.

    Args:
        spec: Gymnasium's spec.
        horizon: control steps after which an episode is truncated.
    """
    if spec is None:
        return None
    arguments = {
        name: value
        for name, value in spec.kwargs.items()
        if name != "max_episode_steps" or not isinstance(value, DefaultSteps)
    }
    steps = spec.max_episode_steps
    if steps is None or isinstance(steps, DefaultSteps):
        steps = DefaultSteps(horizon)
    return replace(spec, kwargs=plain_options(arguments), max_episode_steps=min(steps, horizon))
