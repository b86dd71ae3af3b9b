"""Typed access to the printed tables."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.serres2008.corrections import FILES, Row, corrections, printed_rows


@dataclass(frozen=True)
class Table:
    """One table: an array a column, named with its unit.

    Attributes:
        name: "I3", "18"; "text" and "conversions" hold figures that the text states.
        title: what the table shows.
        columns: arrays of shape (rows,), read-only; numbers in the unit of the column's name,
            NaN where nothing is printed or the figure is lost, or words.
        printed: the same cells as printed, never corrected.
    """

    name: str
    title: str
    columns: Mapping[str, NDArray]
    printed: Mapping[str, tuple[str, ...]]

    def __len__(self) -> int:
        return len(next(iter(self.printed.values())))

    def __getitem__(self, column: str) -> NDArray:
        """A column.

        Raises:
            KeyError: no such column; the message lists the table's columns.
        """
        if column not in self.columns:
            raise KeyError(
                f"table {self.name} has no column {column!r}; it has {', '.join(self.columns)}"
            )
        return self.columns[column]

    def where(self, **values: float | str) -> "Table":
        """The rows whose columns have these values.

        >>> load_table("18").where(pressure_kpa=450)["v1_m_per_v"]
        array([0.007])
        """
        chosen = np.full(len(self), True)
        for column, value in values.items():
            chosen &= self[column] == value
        return Table(
            self.name,
            self.title,
            MappingProxyType({c: _frozen(array[chosen]) for c, array in self.columns.items()}),
            MappingProxyType(
                {
                    column: tuple(text for text, kept in zip(texts, chosen, strict=True) if kept)
                    for column, texts in self.printed.items()
                }
            ),
        )


def _frozen(array: NDArray) -> NDArray:
    array.setflags(write=False)
    return array


def _column(texts: tuple[str, ...]) -> NDArray:
    """Numbers if every cell is one or empty; else words."""
    try:
        return np.array([float(text) if text else np.nan for text in texts])
    except ValueError:
        return np.array(texts)


def _texts(rows: list[Row]) -> dict[str, tuple[str, ...]]:
    return {column: tuple(row[column] for row in rows) for column in rows[0]}


def load_table(name: str, corrected: bool = True) -> Table:
    """A table of the dissertation.

    Args:
        name: "I1" to "I20", "2", "4" to "30", "text" or "conversions"; see `table_names`.
        corrected: with the misprints of `corrections` mended (a figure that is lost becomes NaN);
            False gives what is printed.

    Raises:
        KeyError: no such table; the message lists the tables.

    >>> load_table("I1")["load_n"][:3]
    array([184., 185., 185.])
    """
    texts = _texts(printed_rows(name))
    columns = {column: _column(cells) for column, cells in texts.items()}
    for item in corrections(name) if corrected else ():
        columns[item.column][item.row] = item.corrected
    frozen = {column: _frozen(array) for column, array in columns.items()}
    return Table(name, FILES[name][1], MappingProxyType(frozen), MappingProxyType(texts))


def table_names() -> tuple[str, ...]:
    """The names that `load_table` knows."""
    return tuple(FILES)


_RESULTS = {"displacement": "22", "rotation": "30"}


def pressures(task: str) -> tuple[int, ...]:
    """Pressures (kPa) at which a task was measured.

    Args:
        task: "displacement" or "rotation".

    Raises:
        KeyError: no such task.

    >>> pressures("rotation")
    (275, 300, 350, 400, 450, 500, 550, 575)
    """
    if task not in _RESULTS:
        raise KeyError(f"no task {task!r} in Serres 2008; there are {', '.join(_RESULTS)}")
    return tuple(int(value) for value in load_table(_RESULTS[task])["pressure_kpa"])
