"""Users' effects: a Python file whose effects are added to the catalogue.

    from typing import Annotated, NamedTuple
    from pma_gym.effects import Effect
    from pma_gym.units import Quantity

    class Drag(NamedTuple):
        factor: Annotated[
            float, Quantity("N s^2/mm^2", 0, 1, "assumption: 0.002", 0.0, usual=0.002)
        ]

    def drag(velocity, p):
        return -p.factor * velocity * abs(velocity)

    DRAG = Effect("drag", "slide_force", Drag, drag, signature="force as the square of speed")

A file is run where its user names it and nowhere else: in the option `--effect` of a command, in a
call of `load_effects`, or in the environment variable `PMA_GYM_EFFECTS`. A model file names the
file of its user effects too, but only for people: no model, data set or pickle runs code.
`load_effects` runs the file as `python file.py` would, checks the effects that it defines, and adds
them to the catalogue of this process and the file to `PMA_GYM_EFFECTS`, which worker processes
inherit.
"""

import hashlib
import importlib.util
import os
import shlex
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from pma_gym.effects import CATALOGUE, Effect
from pma_gym.effects.effect import antagonist
from pma_gym.effects.rig_ports import SECOND_PORTS
from pma_gym.effects.user_effect_checks import broken_rule, numbers
from pma_gym.files import as_path

NAMED = "PMA_GYM_EFFECTS"
"""Environment variable with files of effects, separated as in PATH; `load_effects` adds to it."""

EFFECTS_FROM = "effects_from"
"""Key of a model file with the names of the Python files that its user effects come from."""

HEAD = ("schema", "name", "title", "plant", EFFECTS_FROM)
"""Keys of a model file that are not effects; the last one only where it has user effects."""

_named = ""
"""Value of the environment variable whose files were loaded."""

_sources: dict[str, "_Source"] = {}
"""Source file of every user effect, by the effect's name."""


class _Source(NamedTuple):
    """A file, its text, and a hash of all that an effect's compiled code depends on."""

    path: Path
    text: str
    digest: str


class OwnEffectError(ValueError):
    """A file of effects cannot be used; the message names the effect, the rule and the fix."""


def load_effects(path: str | Path) -> list[Effect]:
    """Run a Python file and add the effects that it defines to the catalogue.

    Args:
        path: the file. Loading it again applies the changes made to it, if any.
    Returns:
        The effects, as defined at the top of the file, in order.
    Raises:
        OwnEffectError: the file cannot be run or defines no effect, or an effect breaks a rule.
    """
    path = as_path(path, OwnEffectError).resolve()
    if os.pathsep in str(path):
        raise OwnEffectError(
            f"{path}: has {os.pathsep!r} in its path, which separates the files in {NAMED}; "
            "rename it or its folder"
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise OwnEffectError(f"{path}: cannot be read ({error}); name a Python file") from error
    known = [name for name, source in _sources.items() if source.path == path]
    if known and all(_sources[name].text == text for name in known):
        _add_to_environment(path)
        return [CATALOGUE[name] for name in known if not CATALOGUE[name].of]
    module = _run(path, text)
    effects = _defined(module)
    if not effects:
        raise OwnEffectError(
            f"{path}: defines no effect; write NAME = Effect(...) at its top level, with Effect "
            "from pma_gym.effects"
        )
    for i, effect in enumerate(effects):
        _check(path, module, effect, [other.name for other in effects[:i]])
    second = [antagonist(effect) for effect in effects if effect.port in SECOND_PORTS]
    for name in {*known} - {effect.name for effect in (*effects, *second)}:
        del CATALOGUE[name], _sources[name]
    for effect in (*effects, *second):
        CATALOGUE[effect.name] = effect
        _sources[effect.name] = _Source(path, text, _digest(effect, text))
    _add_to_environment(path)
    return effects


def load_named_effects() -> None:
    """Load the files that the environment variable names, unless that is done.

    Raises:
        OwnEffectError: as `load_effects`.
    """
    global _named
    named = os.environ.get(NAMED, "")
    if named == _named:
        return
    paths = [str(Path(name).resolve()) for name in named.split(os.pathsep) if name]
    # Before they run: a file may ask for a model. Whole paths: a worker may run in another folder.
    _named = os.environ[NAMED] = os.pathsep.join(paths)
    for path in paths:
        try:
            load_effects(path)
        except OwnEffectError as error:
            _named = ""
            raise OwnEffectError(f"{NAMED} names {error}") from error


def _add_to_environment(path: Path) -> None:
    paths = [name for name in os.environ.get(NAMED, "").split(os.pathsep) if name]
    if str(path) not in paths:
        os.environ[NAMED] = os.pathsep.join([*paths, str(path)])


def how_to_load(names: Sequence[str]) -> str:
    """Say how to load the files that user effects come from.

    >>> how_to_load(["mine.py"]).partition(",")[0]
    'add --effect mine.py to the command'
    """
    options = " ".join(f"--effect {shlex.quote(name)}" for name in names)
    calls = ", ".join(f'load_effects("{name}")' for name in names)
    return (
        f"add {options} to the command, call {calls} of pma_gym.effects.user_effects first, or set "
        f"the environment variable {NAMED}={shlex.quote(os.pathsep.join(names))}"
    )


def source_of(name: str) -> str:
    """Hash of the source text of a user's effect, for keys of compiled code; empty for others."""
    return _sources[name].digest if name in _sources else ""


def sources_of(names: Iterable[str]) -> dict[str, str]:
    """Names of the files that user effects among these come from, with a hash of those effects."""
    parts: dict[str, list[str]] = {}
    for name in names:
        if name in _sources:
            parts.setdefault(_sources[name].path.name, []).append(_sources[name].digest)
    return {
        file: hashlib.sha256(" ".join(digests).encode()).hexdigest()[:16]
        for file, digests in sorted(parts.items())
    }


def loaded_digest() -> str:
    """Hash of all user effects of this process, which a diagnosis tries; empty without any."""
    load_named_effects()
    return " ".join(sources_of(_sources).values())


def _digest(effect: Effect, text: str) -> str:
    # Numbers may come from elsewhere than the file.
    around = sorted({f"{key}={value!r}" for law in effect.laws() for key, value in numbers(law)})
    return hashlib.sha256("\0".join((text, *around)).encode()).hexdigest()


def _run(path: Path, text: str) -> ModuleType:
    name = f"pma_gym_own_{path.stem}_{hashlib.sha256(f'{path}{text}'.encode()).hexdigest()[:12]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None:
        raise OwnEffectError(f"{path}: is no Python file; its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    # Annotations and `inspect` look the module up there.
    sys.modules[name] = module
    try:
        # The text that was read, not compiled bytes of an earlier one.
        exec(compile(text, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise OwnEffectError(
            f"{path}: cannot be run: {type(error).__name__}: {error}{_line(error, path)}; "
            f"try python {path.name}"
        ) from error
    return module


def _line(error: BaseException, path: Path) -> str:
    """Where in the file it failed, in words."""
    line, trail = None, error.__traceback__
    while trail is not None:
        line = trail.tb_lineno if trail.tb_frame.f_code.co_filename == str(path) else line
        trail = trail.tb_next
    line = error.lineno if isinstance(error, SyntaxError) else line
    return "" if line is None else f" (line {line})"


def _defined(module: ModuleType) -> list[Effect]:
    """Effects that the module defines itself, each once."""
    catalogue = {id(effect) for effect in CATALOGUE.values()}
    effects: dict[int, Effect] = {}
    for value in vars(module).values():
        if isinstance(value, Effect) and id(value) not in catalogue:
            effects[id(value)] = value
    return list(effects.values())


def _check(path: Path, module: ModuleType, effect: Effect, others: list[str]) -> None:
    """Refuse an effect that a station could not have, or a diagnosis could not leave out."""
    wrong = _name(effect.name, path, others) or broken_rule(effect, module)
    if wrong:
        raise OwnEffectError(f"{path}: [{effect.name}] {wrong}")


def _name(name: str, path: Path, others: list[str]) -> str:
    if not isinstance(name, str) or not name.isidentifier() or name in HEAD:
        return "needs a name of letters, digits and _, for its table in a model file"
    if name in others:
        return "is there twice in this file; give each effect a name of its own"
    if name in CATALOGUE and (name not in _sources or _sources[name].path != path):
        origin = _sources[name].path if name in _sources else "the catalogue"
        return f"has a name that {origin} has already; choose another, such as own_{name}"
    return ""
