"""Limits on files that are read, checked before memory is taken.

A file from a stranger may unpack to gigabytes. Every reader asks here, by the name of the limit, so
that one table says what is read and one rule says how to raise it.
"""

import os
from dataclasses import dataclass


class LimitError(ValueError):
    """A file beyond a limit; the message names the file, the limit, what came and the fix."""


@dataclass(frozen=True)
class Limit:
    """One limit of the readers.

    Attributes:
        usual: its value where the environment sets none.
        unit: what it counts, in words.
    """

    usual: int
    unit: str


LIMITS = {
    "file_mib": Limit(1024, "MiB a file"),
    "unpacked_mib": Limit(1024, "MiB that a compressed file unpacks to"),
    "text_mib": Limit(256, "MiB a text file"),
    "table_mib": Limit(256, "MiB that the tables of a packed file (XLSX, Parquet, MAT) unpack to"),
    "packing": Limit(100, "MiB unpacked for each MiB of a workbook"),
    "document_kib": Limit(4096, "KiB a TOML, JSON or YAML document"),
    "rows": Limit(5_000_000, "rows a table"),
    "columns": Limit(1000, "columns a table"),
    "cells": Limit(20_000_000, "cells a table"),
    "cell_characters": Limit(10_000, "characters a cell"),
    "sheets": Limit(200, "sheets a workbook"),
    "reading_mib": Limit(2048, "MiB of memory, beside the file, to read a binary file"),
    "reading_s": Limit(60, "s to read a binary file"),
    "toml_kib": Limit(1024, "KiB a TOML document"),
    "yaml_kib": Limit(256, "KiB a YAML document"),
    "values": Limit(200_000, "names or values in a document or a binary file"),
    "journal_mib": Limit(16, "MiB a file of a run's journal"),
    "weights_mib": Limit(4096, "MiB a file of weights"),
    "nesting": Limit(50, "levels of nesting in a document"),
    "digits": Limit(400, "digits a number"),
}
"""All limits by name. The defaults are this project's choice: far above any log of a test rig."""

PREFIX = "PMA_GYM_MAX_"
"""Begins the names of the environment variables that set limits: PMA_GYM_MAX_ROWS."""


def limit(name: str) -> int:
    """Return a limit: from the environment variable, else the default.

    Raises:
        LimitError: the environment's value is no positive whole number.
    """
    text = os.environ.get(PREFIX + name.upper())
    if text is None:
        return LIMITS[name].usual
    if not (text.isascii() and text.isdigit() and 0 < len(text) <= 18 and int(text)):
        raise LimitError(
            f"{PREFIX}{name.upper()} must be a positive whole number ({LIMITS[name].unit}), got "
            f"{text[:40]!r}; correct it or unset it (then it is {LIMITS[name].usual})"
        )
    return int(text)


def check_limit(file: str, name: str, value: float) -> None:
    """Refuse a value beyond a limit.

    Args:
        file: the file's name, for the message.
        name: of the limit.
        value: what the file holds or announces, in the limit's unit.
    Raises:
        LimitError: names the file, the limit, what came and how to raise it.
    """
    most = limit(name)
    if value > most:
        raise LimitError(
            f"{file} is beyond the limit of {most} {LIMITS[name].unit}: it has {value:.6g}; if the "
            f"file is sound, set the environment variable {PREFIX}{name.upper()} to a larger number"
        )
