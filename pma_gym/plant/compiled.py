"""Compiles a plant's generated module with numba and keeps the result on disk by content.

The only importer of numba. A module is named by a hash of its own text, of every module that it
takes a law or a parameter class from, and of the versions of numba and Python, so that an edit
anywhere makes a new one; numba's own cache would not notice an edit in another file.
"""

import atexit
import hashlib
import importlib
import importlib.util
import os
import re
import shutil
import sys
import tempfile
import types
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.extending import register_jitable

from pma_gym.files import replace_file

COMPILED = ("derivative", "observe", "advance", "simulate")
"""Functions of a generated module that are compiled for calls from Python."""

# A law divides by no parameter that may be 0; without the check, divisions can be reordered.
_OPTIONS: dict[str, Any] = {"error_model": "numpy"}


def cache_directory() -> Path:
    """Folder of compiled plants: $PMA_GYM_CACHE, else the user's cache folder.

    Falls back to a temporary folder, and says so once, where that cannot be written.
    """
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return _writable(Path(os.environ.get("PMA_GYM_CACHE") or Path(home) / "pma_gym"))


@cache
def _writable(wanted: Path) -> Path:
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        warnings.warn(
            f"cannot write compiled plants to {wanted} ({error}); compiling into a temporary "
            "folder for this process; set PMA_GYM_CACHE to a writable folder to keep them",
            stacklevel=2,
        )
    folder = Path(tempfile.mkdtemp(prefix="pma_gym_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def compile_module(text: str) -> types.ModuleType:
    """The generated module of this text, imported from the cache folder and compiled."""
    module = import_text(text)
    for name in _sources(text):
        _make_compilable(name)
    for name in ("rate", *COMPILED):
        setattr(module, name, numba.njit(cache=True, **_OPTIONS)(getattr(module, name)))
    return module


def import_text(text: str) -> types.ModuleType:
    """The generated module as plain Python, written to and imported from the cache folder."""
    name = f"plant_{key(text)}"
    path = cache_directory() / name / f"{name}.py"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, text.encode("utf-8"))
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def key(text: str) -> str:
    """Name of a generated module: a hash of all that its compiled form depends on."""
    parts = [text, *_sources(text).values(), str(_OPTIONS), numba.__version__, sys.version]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def _sources(text: str) -> dict[str, str]:
    """Texts of the modules that a module calls functions of, directly or not, by name."""
    waiting, sources = re.findall(r"^from (pma_gym\S*) import", text, re.MULTILINE), {}
    while waiting:
        name = waiting.pop()
        if name in sources:
            continue
        module = importlib.import_module(name)
        sources[name] = _source(module)
        waiting += [f.__module__ for f in _functions(module) if f.__module__.startswith("pma_gym.")]
    return dict(sorted(sources.items()))


def _source(module: types.ModuleType) -> str:
    assert module.__file__ is not None
    return Path(module.__file__).read_text(encoding="utf-8")


def _functions(module: types.ModuleType) -> list[types.FunctionType]:
    return [f for f in vars(module).values() if isinstance(f, types.FunctionType)]


@cache
def _make_compilable(name: str) -> None:
    for function in _functions(sys.modules[name]):
        if function.__module__ == name:
            register_jitable(**_OPTIONS)(function)
