"""Gymnasium environments; importing this registers them."""

import gymnasium as gym

from pma_gym.engine.option_checks import RewardFunction
from pma_gym.engine.options import Options
from pma_gym.engine.snapshot import StateError
from pma_gym.envs.pma_env import PMAEnv
from pma_gym.envs.rig_env import RigEnv, RigInfo, RigVectorEnv
from pma_gym.envs.specs import DefaultSteps, single_wrappers
from pma_gym.envs.state import EnvState
from pma_gym.envs.station_info import Measurement, Reference, StationInfo
from pma_gym.envs.vector import PMAVectorEnv
from pma_gym.tasks import EVERY_TASK

ENVIRONMENTS = {
    "pma_gym/IsokineticDisplacement-v0": "displacement",
    "pma_gym/IsokineticRotation-v0": "rotation",
    "pma_gym/IsotonicContraction-v0": "isotonic",
    "pma_gym/ResistiveExercise-v0": "isokinetic_exercise",
}
"""Registered environment ids with their default tasks; `task=` selects another."""

RIG_ID = "pma_gym/Rig-v0"
"""Registered id of the environment of any rig; `model=` says which."""

_POINTS = ("pma_gym.envs.pma_env:PMAEnv", "pma_gym.envs.vector:PMAVectorEnv")
_RIG_POINTS = ("pma_gym.envs.rig_env:RigEnv", "pma_gym.envs.rig_env:RigVectorEnv")

for _name, _task in [*ENVIRONMENTS.items(), (RIG_ID, None)]:
    # An id stays as it was registered: a user's own entry under it, or a second import's.
    if _name not in gym.registry:
        _steps = Options().horizon(EVERY_TASK[_task or "displacement_steps"])
        _single, _vector = _POINTS if _task else _RIG_POINTS
        gym.register(
            _name,
            entry_point=_single,
            vector_entry_point=_vector,
            # It refuses by itself steps before `reset` and actions that are none, and tells more
            # of them; tests hold that it is what Gymnasium's checker asks for.
            order_enforce=False,
            disable_env_checker=True,
            kwargs={"task": _task} if _task else {},
            # Of the default options. What `make` and `make_vec` make has its own number.
            max_episode_steps=DefaultSteps(_steps),
            additional_wrappers=single_wrappers(_steps),
        )

__all__ = [
    "ENVIRONMENTS",
    "RIG_ID",
    "EnvState",
    "Options",
    "PMAEnv",
    "PMAVectorEnv",
    "Measurement",
    "Reference",
    "RigEnv",
    "RigInfo",
    "RigVectorEnv",
    "RewardFunction",
    "StateError",
    "StationInfo",
]
