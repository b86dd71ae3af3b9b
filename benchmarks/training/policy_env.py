"""One environment behind a view and a form, for any library that takes Gymnasium environments."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from benchmarks.training.stations import Stations
from controllers.policies.adapter import ActionMapping, PolicyAdapter
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.engine.observation import BOUND
from pma_gym.envs import PMAEnv

LEAST_REWARD, BROKEN_REWARD = -10.0, -100.0
"""Least reward of a step that is learned from, and of one that breaks a limit.

Further from the reference than 10 % of the range, and after a limit, one is as bad as another. In
full, the first episodes' rewards (down to -150 000) would drown everything else: some trainings
then learn to stay at 0 V and never leave it.
"""


def bounded(rewards: Any, terminated: Any, scale: float = 1.0) -> Any:  # noqa: ANN401
    """Rewards as they are learned from; of numbers or arrays.

    Args:
        rewards: of the environment.
        terminated: whether a limit broke.
        scale: factor on what is left. Where errors stay large for many steps ahead, returns are
            hundreds, which a critic does not reach in time and which drown the policy's gradient.
    """
    return scale * np.maximum(rewards, np.where(terminated, BROKEN_REWARD, LEAST_REWARD))


class PolicyEnv(gym.Wrapper[NDArray[np.float32], NDArray[np.float32], NDArray[Any], NDArray[Any]]):
    """As `PolicyVecEnv`, one of it: what the presets name as `env_wrapper`.

    Args:
        env: an environment of pma_gym; with `stations` or `options` it is made anew, inside the
            same wrappers (the zoo's Monitor is one).
        view: arguments of the ObservationSpec; of kind tracking.
        form: arguments of the ActionMapping.
        stations: suite whose training stations episodes are on; empty for the environment's own.
        options: options in place of the environment's.
        reward_scale: factor on the bounded rewards.

    Example:
        >>> env = PolicyEnv(
        ...     gym.make("pma_gym/IsokineticDisplacement-v0", pressure_kpa=300),
        ...     view={"kind": "tracking", "preview": 2, "history": 1},
        ...     form={"kind": "increment", "authority_v": 0.5},
        ... )
        >>> observation, _ = env.reset(seed=1)
        >>> observation.shape == env.observation_space.shape
        True
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        view: Mapping[str, Any],
        form: Mapping[str, Any],
        stations: str = "",
        options: Mapping[str, Any] | None = None,
        reward_scale: float = 1.0,
    ) -> None:
        """Make the adapter, and the environment anew if it is to be another."""
        rig = env.unwrapped
        if not isinstance(rig, PMAEnv):
            raise TypeError(f"env must be one of pma_gym, got {type(rig).__name__}")
        if not 0.0 < reward_scale < np.inf:
            raise ValueError(f"reward_scale must be positive and finite, got {reward_scale!r}")
        if stations or options:
            made = _made(rig, stations, options or {})
            env, rig = _exchanged(env, rig, made), made
        super().__init__(env)
        self.rig, self._scale = rig, reward_scale
        self.adapter = PolicyAdapter(
            ObservationSpec.of(view), ActionMapping.of({"base": None} | dict(form))
        )
        if self.adapter.view.kind != "tracking":
            raise ValueError(
                f"view must be of kind tracking, got {self.adapter.view.kind}; on the "
                "environment's own view train with a script of your own, see docs/train-a-policy.md"
            )
        # Refuses a station or a task that the view or the base is not made for.
        self.adapter.reset(rig.reference, rig.station)
        entries = len(self.adapter.view.rows(rig.station, self.adapter.form.base))
        self.observation_space = spaces.Box(-BOUND, BOUND, (entries,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial."""
        _, info = self.env.reset(seed=seed, options=options)
        self.adapter.reset(self.rig.reference, self.rig.station)
        return self.adapter.update(self.rig.measurement, self.rig.time), info

    def step(
        self, action: NDArray[Any]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Command what the action asks for."""
        volts = self.adapter.volts(float(np.asarray(action).reshape(-1)[0]))
        command: Any = self.rig.action(volts)
        _, reward, terminated, truncated, info = self.env.step(command)
        entries = self.adapter.update(self.rig.measurement, self.rig.time)
        return entries, float(bounded(reward, terminated, self._scale)), terminated, truncated, info


def _made(env: PMAEnv, stations: str, options: Mapping[str, Any]) -> PMAEnv:
    """The environment with other options."""
    chosen = {"task": env.task, "render_mode": env.render_mode, **options}
    if not stations:
        return PMAEnv(**chosen)
    if doubled := {"model", "randomisation"} & set(options):
        raise ValueError(
            f"stations give the environment its {' and '.join(sorted(doubled))} already: leave out "
            "the option or the stations"
        )
    return PMAEnv(**chosen, **Stations(stations).options)


def _exchanged(env: gym.Env[Any, Any], rig: PMAEnv, made: PMAEnv) -> gym.Env[Any, Any]:
    """Wrappers of one environment around another."""
    if env is rig:
        return made
    inmost = env
    while isinstance(inmost, gym.Wrapper) and inmost.env is not rig:
        inmost = inmost.env
    inmost.env = made  # type: ignore[attr-defined]
    return env
