"""TOML of model files: conversion of values to text, and the expected form of a line."""

import json

from pma_gym.effects.effect import Value

LINE_FORM = (
    'a line is a table, [effect], or name = value, the value a number 1.5, a text "in quotes" or '
    '{ value = 1.5, source = "where from" }'
)
"""Expected form of a line of a model file, for messages."""


def toml_text(value: str | Value) -> str:
    """Convert a value to TOML text.

    >>> toml_text("50 %"), toml_text((1.0, 0.1 + 0.2))
    ('"50 %"', '[1, 0.3]')
    """
    if isinstance(value, str):
        # The escapes of JSON are those of TOML.
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, tuple):
        return "[" + ", ".join(toml_text(one) for one in value) + "]"
    # Nine digits: below every interval, and free of the last bits that unit factors leave.
    return f"{value:.9g}"
