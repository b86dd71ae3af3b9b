"""Content of `dataset.toml`, the description of a data set.

The table `[format]` of a `dataset.toml`, read and checked.
"""

import codecs
import math
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from pma_gym.data.datasets.lab_sensors import MOST_SIZE, LabSensor, lab_sensors
from pma_gym.data.readers.table import PART, FileFormat, shown
from pma_gym.data.trial_checks import check_memory_at_start
from pma_gym.data.trial_columns import COLUMNS, ColumnMap, TrialError, sources, suggestion
from pma_gym.documents import is_file, read_toml
from pma_gym.units import SI_FACTORS

_SEPARATORS = {",": ",", ";": ";", "\t": "\t", "|": "|", " ": " ", "tab": "\t", "blanks": " "}


class _Key(NamedTuple):
    """A key of `[format]`: what it must be, for messages and as a test, and what is made of it."""

    rule: str
    example: str
    fits: Callable[[Any], object]
    value: Callable[[Any], Any] = lambda value: value


def _one_of(*known: str) -> tuple[str, str, Callable[[Any], object]]:
    return f"one of {', '.join(map(repr, known))}", repr(known[0]), lambda value: value in known


def _is_text_encoding(name: object) -> bool:
    """Whether a codec makes text of bytes: not "zip", nor those of internet names."""
    try:
        # The bytes need not be text in it.
        b"aaaa".decode(codecs.lookup(str(name)).name, "replace")
    except (LookupError, ValueError):
        return False
    return codecs.lookup(str(name)).name not in ("idna", "punycode", "undefined")


def _listed(value: Any) -> list[Any]:  # noqa: ANN401
    return value if isinstance(value, list) else [value]


_FORMAT = {
    "separator": _Key(*_one_of(*_SEPARATORS), _SEPARATORS.get),
    "decimal": _Key(*_one_of(".", ",")),
    "encoding": _Key("the name of a text encoding", '"cp1252"', _is_text_encoding),
    "header_row": _Key(
        "a row's number, counted from 1", "3", lambda value: type(value) is int and value > 0
    ),
    "names": _Key(
        "a list of texts",
        '["time_s", "motor_voltage_v"]',
        lambda value: value and isinstance(value, list) and {*map(type, value)} == {str},
        lambda value: tuple(name.strip() for name in value),
    ),
    "missing": _Key(
        "a list of numbers",
        "[-999]",
        # A whole number of TOML may be beyond the doubles.
        lambda value: all(type(x) in (int, float) and abs(x) < 1e308 for x in _listed(value)),
        lambda value: tuple(map(float, _listed(value))),
    ),
    "interpolation": _Key(*_one_of("foh", "zoh")),
}


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
    _check_keys(f"[format] of {DESCRIPTION}", table, tuple(_FORMAT))
    for key, value in table.items():
        rule, example, fits, _ = _FORMAT[key]
        if not fits(value):
            raise TrialError(
                f"{key} in [format] of {DESCRIPTION} must be {rule}, got {shown(value)}; "
                f"write {key} = {example}"
            )
    if "separator" in table and table["separator"] == table.get("decimal"):
        raise TrialError(
            f"[format] of {DESCRIPTION} gives {table['separator']!r} as separator and as decimal; "
            "change one"
        )
    return FileFormat(**{key: _FORMAT[key].value(value) for key, value in table.items()})


DESCRIPTION = "dataset.toml"
_KEYS = ("title", "model", "columns", "format", "sensors", "trials", "tolerance", "standard_error")
_TRIAL_KEYS = ("order", "repeat_of", "note", "memory_at_start")
_LINE_FORM = (
    'a line is a table, [columns], or name = value, a text in quotes: "Weg" = "contraction_mm"'
)
_shown = reprlib.repr


@dataclass(frozen=True)
class Description:
    """The content of `dataset.toml`; all of it may be missing.

    Attributes:
        title: a line for people; empty if none is given.
        model: name or path of a model, or None.
        columns: the lab's column names to ours.
        form: what the files leave open: separator, decimal mark, encoding...
        trials: `order`, `repeat_of`, `note` and `memory_at_start` by file name.
        tolerance: misfit that is good enough, by measurement (SI): `contraction`.
        standard_error: of readings that are rows of a table, by measurement (SI).
        sensors: what is stated of sensors, by measurement.
    """

    title: str = ""
    model: str | None = None
    columns: ColumnMap = field(default_factory=dict)
    form: FileFormat = field(default_factory=FileFormat)
    trials: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    tolerance: Mapping[str, float] = field(default_factory=dict)
    standard_error: Mapping[str, float] = field(default_factory=dict)
    sensors: Mapping[str, LabSensor] = field(default_factory=dict)


def read_description(folder: Path, files: Sequence[str]) -> Description:
    """Read a folder's `dataset.toml`; an empty description if there is none.

    Args:
        folder: the data set.
        files: names of its trials' files.
    Raises:
        TrialError: no TOML, unknown keys, a trial or a model file that is not there.
    """
    path = folder / DESCRIPTION
    if not path.is_file():
        near = [p.name for p in folder.glob("*.toml") if p.stem.lower() in ("dataset", "data_set")]
        if near:
            raise TrialError(f"{folder / near[0]} must be called {DESCRIPTION}; rename it")
        return Description()
    document = _parsed(path)
    _check_keys(f"{DESCRIPTION}", document, _KEYS)
    columns = _table(document, "columns")
    for name in columns:
        try:
            # Alone: two names of one quantity are two layouts of files, if no file has both.
            sources([name], columns, DESCRIPTION)
        except TrialError as error:
            raise TrialError(f"{DESCRIPTION}: {error}") from None
    return Description(
        title=_text(document, "title", DESCRIPTION) or "",
        model=_model(folder, _text(document, "model", DESCRIPTION)),
        columns=columns,
        form=file_format(_table(document, "format")),
        trials=_trials(_table(document, "trials"), files),
        tolerance=_sizes(document, "tolerance", "contraction_mm = 0.2"),
        standard_error=_sizes(document, "standard_error", "contraction_mm = 0.05"),
        sensors=lab_sensors(_table(document, "sensors"), f"[sensors] of {DESCRIPTION}"),
    )


def _parsed(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path, _LINE_FORM)
    except ValueError as error:
        raise TrialError(str(error)) from None


def _check_keys(place: str, keys: Iterable[str], known: Sequence[str]) -> None:
    for key in keys:
        if key not in known:
            raise TrialError(
                f"{place} takes {', '.join(known)}, got {key!r}{suggestion(key, known)}; remove or "
                "rename it"
            )


def _table(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        raise TrialError(f"{key} in {DESCRIPTION} must be a table, [{key}], got {_shown(table)}")
    return table


def _text(table: Mapping[str, Any], key: str, place: str) -> str | None:
    value = table.get(key)
    if value is not None and (not isinstance(value, str) or not value.strip()):
        raise TrialError(f'{key} in {place} must be a text, {key} = "...", got {_shown(value)}')
    return value


def _sizes(document: Mapping[str, Any], key: str, example: str) -> dict[str, float]:
    """A table of sizes by measurement's column, in SI by quantity."""
    known = {column.name: column for column in COLUMNS if column.kind == "measurement"}
    table, sizes = _table(document, key), {}
    _check_keys(f"[{key}] in {DESCRIPTION}", table, list(known))
    for name, size in table.items():
        number = size if isinstance(size, int | float) and not isinstance(size, bool) else math.nan
        unit = known[name].unit
        if not 0.0 < number < MOST_SIZE:
            raise TrialError(
                f"{name} in [{key}] of {DESCRIPTION} must be a number in {unit}, above 0 and below "
                f"{MOST_SIZE:g}, got {size!r}; write {example}"
            )
        sizes[known[name].quantity] = float(number) * SI_FACTORS[unit]
    return sizes


def _model(folder: Path, name: str | None) -> str | None:
    """The model's name, or its file as seen from here."""
    if name is None or not (name.endswith(".toml") or "/" in name or "\\" in name):
        return name
    path = folder / name
    if not is_file(path):
        raise TrialError(
            f"model in {DESCRIPTION} is {name!r}, but there is no file {path}; a path counts "
            "from the data set's folder"
        )
    return str(path)


def _trials(tables: Mapping[str, Any], files: Sequence[str]) -> dict[str, dict[str, Any]]:
    """What is said about each trial, checked."""
    for name, table in tables.items():
        # Which parts a file has is known when it has been read.
        if name not in files and name.partition(PART)[0] not in files:
            raise TrialError(
                f'[trials."{name}"] in {DESCRIPTION} names no file of the data set'
                f"{suggestion(name, files)}; write the file's whole name, ending included"
            )
        place = f'[trials."{name}"] in {DESCRIPTION}'
        if not isinstance(table, dict):
            raise TrialError(f"{place} must be a table, got {_shown(table)}")
        _check_keys(place, table, _TRIAL_KEYS)
        _text(table, "note", place)
        _check_order(place, table.get("order", 0.0))
        check_memory_at_start(table.get("memory_at_start"), place)
        _check_repeat(place, name, _text(table, "repeat_of", place), tables, files)
    return {name: {**table} for name, table in tables.items()}


def _check_order(place: str, order: object) -> None:
    number = order if isinstance(order, int | float) and not isinstance(order, bool) else math.nan
    if not math.isfinite(number):
        raise TrialError(
            f"order in {place} must be a number, the larger the later it was measured, got "
            f"{_shown(order)}; write order = 1 for the first"
        )


def _check_repeat(
    place: str, name: str, original: str | None, tables: Mapping[str, Any], files: Sequence[str]
) -> None:
    if original is None:
        return
    if original not in files and original.partition(PART)[0] not in files:
        raise TrialError(
            f"repeat_of in {place} is {original!r}, which names no trial"
            f"{suggestion(original, files)}; write the file's whole name, ending included"
        )
    further = tables.get(original, {})
    if original == name or (isinstance(further, dict) and further.get("repeat_of")):
        raise TrialError(
            f"repeat_of in {place} is {original!r}, which is itself a repeat; name the first trial "
            "with these commands in all its repeats"
        )
