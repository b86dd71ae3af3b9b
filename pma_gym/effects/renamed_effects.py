"""Effects by earlier names: the models that users keep have them."""

from collections.abc import Mapping
from typing import Any

from pma_gym.effects import CATALOGUE

RENAMED_EFFECTS: Mapping[str, str] = {"operator": "hand_push"}
"""New names by old ones."""


def effect_name(name: str) -> str:
    """An effect's present name; a user's own effect may have a name that was free again.

    >>> effect_name("operator"), effect_name("slide")
    ('hand_push', 'slide')
    """
    return name if name in CATALOGUE else RENAMED_EFFECTS.get(name, name)


def with_present_names(tables: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept by effect, or by `effect.parameter`, by the effects' present names.

    A table that stands there by both names stays, for whoever reads it to refuse.
    """
    new = {}
    for path, table in tables.items():
        effect, dot, parameter = path.partition(".")
        now = f"{effect_name(effect)}{dot}{parameter}"
        new[path if now in tables else now] = table
    return new
