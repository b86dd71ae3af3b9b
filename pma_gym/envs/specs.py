"""What Gymnasium's specs say of these environments: their number of steps, plain arguments.

Gymnasium puts a TimeLimit of the registered number of steps around what `gym.make` makes. An
environment truncates by itself, and with other options after another number of steps, so that this
wrapper would cut episodes short. `own_time_limit` takes it off again; a number of steps that the
user asks for becomes the environment's own.
"""

from dataclasses import replace
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec, WrapperSpec

from pma_gym.engine.options import DefaultSteps
from pma_gym.engine.plain_values import plain_options


class SingleEnvWrappers(tuple[WrapperSpec, ...]):
    """Wrappers that `gym.make` applies and that `gym.make_vec` takes for none.

    `make` goes through them. `make_vec` refuses to make a batch of an id with wrappers, by their
    number; but a batch has its own number of steps and needs none of these.
    """

    def __len__(self) -> int:
        """None that a batch would miss."""
        return 0


def single_wrappers(steps: int) -> SingleEnvWrappers:
    """The wrappers of a spec whose options give so many steps."""
    default = {"default": DefaultSteps(steps)}
    return SingleEnvWrappers(
        (WrapperSpec("own_time_limit", f"{__name__}:own_time_limit", default),)
    )


def own_time_limit(env: gym.Env[Any, Any], default: int) -> gym.Env[Any, Any]:
    """Replace the TimeLimit around an environment by the environment's own limit.

    `gym.make` calls it as it calls a wrapper.

    Args:
        env: what `gym.make` has made so far.
        default: number of steps that the spec's options gave; of type DefaultSteps unless the spec
            was read from JSON, where only the value can tell it from a user's number.
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
    """A spec with plain arguments, for JSON, and with the true number of steps.

    Args:
        spec: as Gymnasium wrote it.
        horizon: control steps after which an episode is truncated.
    """
    if spec is None:
        return None
    given = {
        name: value
        for name, value in spec.kwargs.items()
        if name != "max_episode_steps" or not isinstance(value, DefaultSteps)
    }
    steps = spec.max_episode_steps
    if steps is None or isinstance(steps, DefaultSteps):
        steps = DefaultSteps(horizon)
    return replace(spec, kwargs=plain_options(given), max_episode_steps=min(steps, horizon))
