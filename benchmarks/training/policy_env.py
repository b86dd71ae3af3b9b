"""One environment behind a view and a form, for any library that takes Gymnasium environments."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from benchmarks.training.reward import bounded
from benchmarks.training.stations import Stations
from controllers.policies.adapter import ActionMapping, PolicyAdapter
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.engine.observation import BOUND
from pma_gym.envs import PMAEnv


class PilotedEnv(gym.Wrapper[NDArray[np.float32], NDArray[np.float32], NDArray[Any], NDArray[Any]]):
    """As `PilotedVecEnv`, one of it: what the presets name as `env_wrapper`.

    Args:
        env: an environment of pma_gym; with `stations` or `options` it is made anew, inside the
            same wrappers (the zoo's Monitor is one).
        view: arguments of the ObservationSpec.
        form: arguments of the ActionMapping.
        stations: suite whose training stations episodes are on; empty for the environment's own.
        options: options in place of the environment's.
        reward_scale: factor on the bounded rewards.

    Example:
        >>> env = PilotedEnv(
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
        """Make the pilot, and the environment anew if it is to be another."""
        rig = env.unwrapped
        if not isinstance(rig, PMAEnv):
            raise TypeError(f"env must be one of pma_gym, got {type(rig).__name__}")
        if stations or options:
            made = _made(rig, stations, options or {})
            env, rig = _exchanged(env, rig, made), made
        super().__init__(env)
        self.rig, self._scale = rig, reward_scale
        self.pilot = PolicyAdapter(
            ObservationSpec.of(view), ActionMapping.of({"base": None} | dict(form))
        )
        station = rig.station
        entries = len(self.pilot.view.rows(station, self.pilot.form.base))
        self.observation_space = spaces.Box(-BOUND, BOUND, (entries,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a trial."""
        _, info = self.env.reset(seed=seed, options=options)
        self.pilot.reset(self.rig.reference, self.rig.station)
        return self.pilot.update(self.rig.measurement, self.rig.time), info

    def step(
        self, action: NDArray[Any]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Command what the action asks for."""
        volts = self.pilot.volts(float(np.asarray(action).reshape(-1)[0]))
        command: Any = self.rig.action(volts)
        _, reward, terminated, truncated, info = self.env.step(command)
        entries = self.pilot.update(self.rig.measurement, self.rig.time)
        return entries, float(bounded(reward, terminated, self._scale)), terminated, truncated, info


def _made(env: PMAEnv, stations: str, options: Mapping[str, Any]) -> PMAEnv:
    """The environment with other options."""
    chosen = dict(options)
    if stations:
        drawn = Stations(stations)
        chosen |= {"randomisation": drawn, "model": drawn.structure}
    return PMAEnv(env.task, env.render_mode, **chosen)


def _exchanged(env: gym.Env[Any, Any], rig: PMAEnv, made: PMAEnv) -> gym.Env[Any, Any]:
    """Wrappers of one environment around another."""
    if env is rig:
        return made
    inmost = env
    while isinstance(inmost, gym.Wrapper) and inmost.env is not rig:
        inmost = inmost.env
    inmost.env = made  # type: ignore[attr-defined]
    return env
