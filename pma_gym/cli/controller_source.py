"""Controllers named on a command line: a class in a file or a module."""

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from pma_gym.envs import Measurement, Reference, StationInfo


class ControllerSourceError(ValueError):
    """A controller cannot be created; the message has the reason and the fix."""


class Runnable(Protocol):
    """Interface of a controller; see `controllers.registry` in a clone."""

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Prepare for a trial."""
        ...

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage of the task's actuator (V) for the next control period."""
        ...


def controller_of(source: str) -> Runnable:
    """Create the controller of `file.py:Class` or `module:Class`, without arguments.

    This executes the file or module, so name only one that you trust.

    Raises:
        ControllerSourceError: the file, module or class is missing, or its code raised an error.
    """
    place, _, name = source.rpartition(":")
    if not place or not name.isidentifier():
        raise ControllerSourceError(
            f"a controller is named file.py:Class or module:Class, got {source!r}"
        )
    if place.endswith(".py"):
        made = class_in_file(Path(place), name)
    else:
        made = _class_of(_imported(place), place, name)
    try:
        controller: Any = made()
    except Exception as error:
        raise ControllerSourceError(
            f"cannot make {source}: {name}() raised {type(error).__name__}: {error}; a controller "
            "needs no arguments"
        ) from error
    missing = [method for method in ("reset", "act") if not callable(getattr(made, method, None))]
    if missing:
        raise ControllerSourceError(
            f"{source} is no controller: it has no method {' and no method '.join(missing)}; give "
            "it reset(reference, station) and act(measurement, time)"
        )
    return controller


def class_in_file(path: Path, name: str) -> type:
    """Return a class of a file, which is executed once in each process.

    Raises:
        ControllerSourceError: the file or the class is missing, or the file raised an error.
    """
    return _class_of(_from_file(path), str(path), name)


def _class_of(module: ModuleType, place: str, name: str) -> type:
    made = getattr(module, name, None)
    if not isinstance(made, type):
        raise ControllerSourceError(f"{place} has no class {name!r}; it has {_classes(module)}")
    return made


def _from_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise ControllerSourceError(f"there is no file {path}; check the name and the folder")
    name = f"controller_{path.resolve().as_posix()}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ControllerSourceError(f"{path} is no Python file; its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    # A dataclass looks up its module by name.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise ControllerSourceError(
            f"cannot import {path}: {type(error).__name__}: {error}"
        ) from error
    return module


def _imported(name: str) -> ModuleType:
    # A console script has not the folder that it is called in on its path.
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        return importlib.import_module(name)
    except Exception as error:
        raise ControllerSourceError(
            f"cannot import {name}: {type(error).__name__}: {error}; a file is named with its "
            f"ending, {name}.py:Class"
        ) from error


def _classes(module: ModuleType) -> str:
    names = [n for n, one in vars(module).items() if isinstance(one, type) and n[0] != "_"]
    return ", ".join(names) or "no class"
