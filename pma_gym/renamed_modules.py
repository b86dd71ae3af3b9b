"""Old names of modules: they import, with a deprecation warning that names the new one.

Users' imports and the pickles of trained policies name modules. An old name stands in one table
here, and no file is left in its place.
"""

import importlib
import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

RENAMED_MODULES: Mapping[str, str] = {
    "pma_gym.discovery.summary": "pma_gym.discovery.report.summary",
    "pma_gym.envs.engine": "pma_gym.engine.engine",
    "pma_gym.envs.snapshot": "pma_gym.engine.snapshot",
    "pma_gym.envs.command": "pma_gym.engine.actions",
    "pma_gym.envs.observation": "pma_gym.engine.observation",
    "pma_gym.envs.options": "pma_gym.engine.options",
    "pma_gym.envs.reward_function": "pma_gym.engine.reward_function",
    "pma_gym.envs.cuda": "pma_gym.engine.cuda.engine",
    "pma_gym.envs.knowledge": "pma_gym.envs.station_info",
    "pma_gym.tasks.guard": "pma_gym.tasks.safety_filter",
    "pma_gym.tasks.human": "pma_gym.tasks.operator",
    "pma_gym.envs.sb3": "pma_gym.sb3.vec_env",
    "pma_gym.envs.sb3_network": "pma_gym.sb3.network",
    "pma_gym.envs.sb3_policy": "pma_gym.sb3.policy",
    "pma_gym.envs.sb3_ppo": "pma_gym.sb3.ppo",
    "pma_gym.data.dataset": "pma_gym.data.datasets.dataset",
    "pma_gym.data.protocol": "pma_gym.data.trial_schedule",
    "pma_gym.data.trial_files": "pma_gym.data.files.trial_files",
    "pma_gym.data.trial_values": "pma_gym.data.files.trial_values",
    "pma_gym.effects.slide.operator": "pma_gym.effects.slide.hand_push",
    "pma_gym.effects.own": "pma_gym.effects.user_effects",
    "pma_gym.plant.exercise": "pma_gym.plant.exercise_device.device",
    "pma_gym.plant.fitting": "pma_gym.estimation.fitting",
    "pma_gym.plant.knee": "pma_gym.plant.exercise_device.knee",
    "pma_gym.plant.muscles": "pma_gym.plant.exercise_device.parallel_muscles",
    "pma_gym.plant.prescription": "pma_gym.plant.exercise_device.prescription",
}
"""Old module names that users may have, and the new ones."""


class _RenamedLoader(Loader):
    """Makes a module whose names are those of another one.

    Args:
        new: name of the other one.
    """

    def __init__(self, new: str) -> None:
        self._new = new

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Create an empty module with the old name."""
        return ModuleType(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Warn, import the new module and redirect every name to it."""
        old = module.__name__
        warnings.warn(
            f"module {old} is now {self._new}; import it by that name",
            DeprecationWarning,
            stacklevel=2,
        )
        new = importlib.import_module(self._new)

        def lookup(name: str) -> Any:  # noqa: ANN401 - whatever the module holds
            with warnings.catch_warnings():  # One warning: names that changed too say it in `new`.
                warnings.simplefilter("ignore", DeprecationWarning)
                return getattr(new, name)

        module.__doc__ = new.__doc__
        module.__dict__["__getattr__"] = lookup
        module.__dict__["__all__"] = [name for name in vars(new) if not name.startswith("_")]


class _RenamedFinder(MetaPathFinder):
    """Finds modules by their old names, where nothing else has.

    Args:
        names: new names by old ones.
    """

    def __init__(self, names: Mapping[str, str]) -> None:
        self.names = names

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of an old name, None for any other."""
        new = self.names.get(fullname)
        return None if new is None else ModuleSpec(fullname, _RenamedLoader(new))


def find_renamed_modules(names: Mapping[str, str] = RENAMED_MODULES) -> None:
    """Install the importer of old module names; once a process.

    Args:
        names: new names by old ones.
    """
    finders = (finder for finder in sys.meta_path if isinstance(finder, _RenamedFinder))
    if not any(finder.names is names for finder in finders):
        sys.meta_path.append(_RenamedFinder(names))
