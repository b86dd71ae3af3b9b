"""The line of `[columns]` that corrects a column, given what `dataset.toml` says of it so far."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from pma_gym.data.datasets.dataset import Dataset
from pma_gym.data.datasets.drafting import quoted
from pma_gym.data.files.trial_files import read_header
from pma_gym.data.trial_columns import (
    BY_QUANTITY,
    Column,
    ColumnMap,
    Source,
    TrialError,
    sources,
)
from pma_gym.units import SI_FACTORS

DESCRIPTION = "dataset.toml"


def lines(
    dataset: Dataset,
    files: Iterable[str],
    quantity: str,
    factor: float,
    offset: float = 0.0,
) -> dict[str, str]:
    """What to write under `[columns]` so that a quantity is read as factor * as now + offset.

    Args:
        dataset: whose `[columns]` to write.
        files: names of the files that it concerns.
        quantity: the quantity.
        factor: by which its values are to be multiplied.
        offset: what is to be added after that (SI).
    Returns:
        By each name that the files give the column, its line, which replaces an older one.
    """
    by_key: dict[str, str] = {}
    for file in files:
        for source in file_sources(dataset, file):
            if source.column.quantity == quantity:
                by_key[source.name] = _line(source, factor, offset)
    if not by_key:
        column = BY_QUANTITY[quantity]
        by_key[column.name] = _line(Source(0, column.name, column), factor, offset)
    return by_key


def instruction(written: Mapping[str, str], columns: ColumnMap) -> str:
    """What to do with lines (by name): write them, or put them in the place of older ones."""
    older = any(name in columns for name in written)
    verb = "write" if not older else "replace the lines of these names by"
    if older and len(written) == 1:
        verb = "replace the line of this name by"
    return f"under [columns] of {DESCRIPTION} {verb}: {'; '.join(written.values())}"


def column_line(name: str, column: Column, entry: Mapping[str, float | list[float]]) -> str:
    """A line of `[columns]`, its numbers with as few digits as name them."""
    numbers = {key: value for key, value in entry.items() if value != _USUAL.get(key)}
    if not numbers:
        return f'{quoted(name)} = "{column.name}"'
    said = ", ".join(f"{key} = {_toml(value)}" for key, value in numbers.items())
    return f'{quoted(name)} = {{ name = "{column.name}", {said} }}'


_USUAL: dict[str, float] = {"factor": 1.0, "offset": 0.0}


def file_sources(dataset: Dataset, file: str) -> list[Source]:
    """What the columns of a file are; nothing where it is no file of its own, a piece say."""
    path = (dataset.folder or Path()) / file
    try:
        header = read_header(path, dataset.columns, dataset.form)
        return sources(header, dataset.columns, file)[0]
    except (TrialError, OSError):
        return []


def _line(source: Source, factor: float, offset: float) -> str:
    column = source.column
    if column.calibration is None:
        moved = offset / SI_FACTORS[column.unit]
    else:
        # In volts: decoding is a line too, so what the decoded value is to be is one in volts.
        zero, unit = column.calibration.to_volts(0.0), column.calibration.to_volts(offset)
        moved = float(zero * (1.0 - factor) + (unit - zero))
    entry: dict[str, float | list[float]] = {
        "factor": source.factor * factor,
        "offset": source.offset * factor + moved,
    }
    if source.ends is not None and column.calibration is None:
        entry["range"] = sorted(end * factor + moved for end in source.ends)
    return column_line(source.name, column, entry)


def _toml(value: float | list[float]) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f"{value:.7g}"
