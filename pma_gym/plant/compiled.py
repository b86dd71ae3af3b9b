"""Compiles a plant's generated module with numba and keeps the result on disk by content.

The only importer of numba. A module is named by a hash of its own text, of all laws that it calls
and of the versions of numba and Python, so that an edit anywhere makes a new one; numba's own cache
would not notice an edit in another file.
"""

import hashlib
import importlib.util
import inspect
import os
import sys
import tempfile
import types
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numba
from numba.extending import register_jitable

from pma_gym.effects import arithmetic
from pma_gym.plant import integrate

COMPILED = ("derivative", "observe", "advance", "simulate")
"""Functions of a generated module that are compiled for calls from Python."""


def cache_directory() -> Path:
    """Folder of compiled plants: $PMA_GYM_CACHE, else the user's cache folder.

    Falls back to a temporary folder, and says so once, where that cannot be written.
    """
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    wanted = Path(os.environ.get("PMA_GYM_CACHE") or Path(home) / "pma_gym")
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        return _fallback_directory(wanted, str(error))


@cache
def _fallback_directory(wanted: Path, reason: str) -> Path:
    warnings.warn(
        f"cannot write compiled plants to {wanted} ({reason}); compiling into a temporary "
        "folder for this process; set PMA_GYM_CACHE to a writable folder to keep them",
        stacklevel=2,
    )
    return Path(tempfile.mkdtemp(prefix="pma_gym_"))


@cache
def compile_module(text: str, laws: tuple[Callable, ...]) -> types.ModuleType:
    """The generated module, imported from the cache folder and compiled.

    Args:
        text: source of the module.
        laws: laws that it calls.
    """
    module = import_text(text, laws)
    for law in laws:
        _make_compilable(sys.modules[law.__module__])
    _make_compilable(arithmetic)
    register_jitable(integrate.coefficients)
    for name in ("rate", *COMPILED):
        setattr(module, name, numba.njit(cache=True)(getattr(module, name)))
    return module


def import_text(text: str, laws: tuple[Callable, ...]) -> types.ModuleType:
    """The generated module as plain Python, written to and imported from the cache folder."""
    name = f"plant_{_key(text, laws)}"
    path = cache_directory() / name / f"{name}.py"
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as file:
            file.write(text)
        os.replace(file.name, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _key(text: str, laws: tuple[Callable, ...]) -> str:
    sources = {law.__module__: inspect.getsource(sys.modules[law.__module__]) for law in laws}
    parts = [text, inspect.getsource(arithmetic), inspect.getsource(integrate)]
    parts += [sources[name] for name in sorted(sources)]
    parts += [numba.__version__, sys.version]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


@cache
def _make_compilable(module: types.ModuleType) -> None:
    for function in list(vars(module).values()):
        if isinstance(function, types.FunctionType) and function.__module__ == module.__name__:
            register_jitable(function)
