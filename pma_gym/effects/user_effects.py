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

`load_effects` runs such a file as `python file.py` would, because the user named it; no other file
is ever run. It checks the effects that the file defines and adds them to the catalogue of this
process, for models, simulations and diagnoses.
"""

import hashlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from pma_gym.effects import CATALOGUE, Effect
from pma_gym.effects.user_effect_checks import broken_rule, numbers
from pma_gym.paths import as_path

_HEAD = ("schema", "name", "title", "plant")
"""Keys of a model file that are not effects."""

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
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise OwnEffectError(f"{path}: cannot be read ({error}); name a Python file") from error
    known = [name for name, source in _sources.items() if source.path == path]
    if known and all(_sources[name].text == text for name in known):
        return [CATALOGUE[name] for name in known]
    module = _run(path, text)
    effects = _defined(module)
    if not effects:
        raise OwnEffectError(
            f"{path}: defines no effect; write NAME = Effect(...) at its top level, with Effect "
            "from pma_gym.effects"
        )
    for i, effect in enumerate(effects):
        _check(path, module, effect, [other.name for other in effects[:i]])
    for name in known:
        del CATALOGUE[name], _sources[name]
    for effect in effects:
        CATALOGUE[effect.name] = effect
        _sources[effect.name] = _Source(path, text, _digest(effect, text))
    return effects


def source_of(name: str) -> str:
    """Hash of the source text of a user's effect, for keys of compiled code; empty for others."""
    return _sources[name].digest if name in _sources else ""


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
    if not isinstance(name, str) or not name.isidentifier() or name in _HEAD:
        return "needs a name of letters, digits and _, for its table in a model file"
    if name in others:
        return "is there twice in this file; give each effect a name of its own"
    if name in CATALOGUE and (name not in _sources or _sources[name].path != path):
        origin = _sources[name].path if name in _sources else "the catalogue"
        return f"has a name that {origin} has already; choose another, such as own_{name}"
    return ""
