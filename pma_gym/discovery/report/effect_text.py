"""Effects in words: their names, what they are, and their equations."""

import inspect
import re
import sys

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.figure_text import listed
from pma_gym.effects import CATALOGUE

_NAMES = {"lvdt": "LVDT", "coulomb": "Coulomb"}

_WHOLE = {"load_dependent_damping": "load-dependent damping"}

_PEOPLE = ("sarosi", "schulte", "schulz", "chou", "hannaford", "caldwell", "tondu", "lopez")


def effect_name(name: str) -> str:
    """An effect's name as people write it.

    >>> effect_name("coulomb_friction"), effect_name("lvdt_error")
    ('Coulomb friction', 'LVDT error')
    """
    if name in _WHOLE:
        return _WHOLE[name]
    words = [
        _NAMES.get(word, word.capitalize() if word in _PEOPLE else word) for word in name.split("_")
    ]
    return " ".join(words)


def effect_names(names: tuple[str, ...] | list[str], joint: str = "and") -> str:
    """Several effects: `creep, hysteresis and filling`."""
    return listed([effect_name(name) for name in names], joint)


def readable(text: str, diagnosis: Diagnosis) -> str:
    """A text with the names of effects as people write them; parameters keep theirs."""
    named = {*CATALOGUE, *(each.name for each in diagnosis.candidates)}
    alternatives = "|".join(sorted((name for name in named if "_" in name), key=len, reverse=True))
    return re.sub(rf"(?<![\w.`])({alternatives})(?![\w.`])", lambda hit: effect_name(hit[1]), text)


def effect_summary(name: str) -> str:
    """What the effect is: the first line of its file, or of its law."""
    effect = CATALOGUE.get(name)
    if effect is None or effect.law is None:
        return ""
    own = sys.modules[effect.law.__module__].__doc__ or effect.law.__doc__ or ""
    return own.strip().splitlines()[0] if own.strip() else ""


def effect_equation(name: str) -> str:
    """The indented lines of the law's docstring, as they stand there; empty if it has none."""
    effect = CATALOGUE.get(name)
    text = (effect.law.__doc__ or "") if effect and effect.law else ""
    match = re.search(r"\n\n((?: {8}\S[^\n]*\n)+)", text)
    return "\n".join(line.strip() for line in match[1].splitlines()) if match else ""


def effect_symbols(name: str) -> str:
    """What stands in the law's equation: the arguments of its docstring, a line each."""
    effect = CATALOGUE.get(name)
    text = (inspect.getdoc(effect.law) or "") if effect and effect.law else ""
    match = re.search(r"\nArgs:\n(.*?)(?=\n\S|\Z)", text, re.DOTALL)
    if not match:
        return ""
    joined = re.sub(r"\n {5,}", " ", match[1])
    return "\n".join(line.strip() for line in joined.splitlines() if line.strip())
