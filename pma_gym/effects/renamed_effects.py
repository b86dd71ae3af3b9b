"""Earlier names of effects, which users' model files may still contain."""

from collections.abc import Mapping
from typing import Any

from pma_gym.effects import CATALOGUE

RENAMED_EFFECTS: Mapping[str, str] = {"operator": "hand_push"}
"""Present names keyed by earlier ones."""


def effect_name(name: str) -> str:
    """Return an effect's present name; a user's effect may reuse an earlier name.

    >>> effect_name("operator"), effect_name("slide")
    ('hand_push', 'slide')
    """
    return name if name in CATALOGUE else RENAMED_EFFECTS.get(name, name)


def with_present_names(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Replace earlier names in keys that are an effect or `effect.parameter`.

    If both names of an effect are present, both stay, so that the reader of the file can reject it.
    """
    new = {}
    for path, table in tables.items():
        effect, dot, parameter = path.partition(".")
        now = f"{effect_name(effect)}{dot}{parameter}"
        new[path if now in tables else now] = table
    return new
