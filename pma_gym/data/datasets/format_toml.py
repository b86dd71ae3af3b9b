"""The table `[format]` of a `dataset.toml`, read and checked."""

import codecs
from collections.abc import Mapping

from pma_gym.data.readers.table import FileFormat, shown
from pma_gym.data.trial_columns import TrialError, suggestion

_SEPARATORS = {",": ",", ";": ";", "\t": "\t", "|": "|", " ": " ", "tab": "\t", "blanks": " "}
_KEYS = ("separator", "decimal", "encoding", "header_row", "names", "missing", "interpolation")


def file_format(table: Mapping[str, object]) -> FileFormat:
    """The format that a table of a `dataset.toml` gives.

    Args:
        table: `separator` (",", ";", "|", "tab" or "blanks"), `decimal` ("." or ","), `encoding`,
            `header_row` (number of the row with the columns' names), `names` (of the columns, where
            no row has them), `missing` (numbers that stand for "not measured"), `interpolation` (of
            commands over empty cells, "foh" or "zoh").
    Raises:
        TrialError: an unknown key or a value of another kind; the message names both and the rule.
    """
    for key in table:
        if key not in _KEYS:
            raise TrialError(
                f"[format] of dataset.toml takes {', '.join(_KEYS)}, got {shown(key)}"
                f"{suggestion(key, _KEYS)}; remove or rename it"
            )
    separator = _choice(table, "separator", tuple(_SEPARATORS))
    decimal = _choice(table, "decimal", (".", ","))
    if separator is not None and separator == decimal:
        raise TrialError(
            f"[format] of dataset.toml gives {separator!r} as separator and as decimal; change one"
        )
    return FileFormat(
        separator=None if separator is None else _SEPARATORS[separator],
        decimal=decimal,
        encoding=_encoding(table.get("encoding")),
        header_row=_header_row(table.get("header_row")),
        names=_names(table.get("names")),
        missing=_missing(table.get("missing")),
        interpolation=_choice(table, "interpolation", ("foh", "zoh")),
    )


def _choice(table: Mapping[str, object], key: str, known: tuple[str, ...]) -> str | None:
    value = table.get(key)
    if value is None or (isinstance(value, str) and value in known):
        return value
    raise _wrong(key, f"one of {', '.join(map(repr, known))}", value, f"{key} = {known[0]!r}")


def _encoding(value: object) -> str | None:
    if value is None:
        return None
    if isinstance(value, str) and _is_text_encoding(value):
        return value
    raise _wrong("encoding", "the name of a text encoding", value, 'encoding = "cp1252"')


def _is_text_encoding(name: str) -> bool:
    """Whether a codec makes text of bytes: not "zip", nor those of internet names."""
    try:
        # The bytes need not be text in it.
        b"aaaa".decode(codecs.lookup(name).name, "replace")
    except (LookupError, ValueError):
        return False
    return codecs.lookup(name).name not in ("idna", "punycode", "undefined")


def _header_row(value: object) -> int | None:
    if value is None or (isinstance(value, int) and not isinstance(value, bool) and value > 0):
        return value
    raise _wrong("header_row", "a row's number, counted from 1", value, "header_row = 3")


def _names(value: object) -> tuple[str, ...]:
    if value is None:
        return ()
    if isinstance(value, list) and value and all(isinstance(name, str) for name in value):
        return tuple(name.strip() for name in value)
    raise _wrong("names", "a list of texts", value, 'names = ["time_s", "motor_voltage_v"]')


def _missing(value: object) -> tuple[float, ...]:
    if value is None:
        return ()
    out: list[float] = []
    for number in value if isinstance(value, list) else [value]:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise _wrong("missing", "a list of numbers", value, "missing = [-999]")
        # A whole number of TOML may be beyond the doubles.
        if not -1e308 < number < 1e308:
            raise _wrong("missing", "a list of finite numbers", value, "missing = [-999]")
        out.append(float(number))
    return tuple(out)


def _wrong(key: str, rule: str, value: object, example: str) -> TrialError:
    return TrialError(
        f"{key} in [format] of dataset.toml must be {rule}, got {shown(value)}; write {example}"
    )
