"""The dissertation's figures, recomputed beside the print: `python -m benchmarks studies`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from benchmarks.dissertation.profiles import write_csv
from pma_gym.studies import VERDICTS, Comparison, compare_all
from pma_gym.terminal import SafeConsole

COLUMNS = ("study", "table", "quantity", "printed", "recomputed", "verdict", "note")
"""Columns of the CSV file."""

_STYLES = {"equal": "green", "rounded": "yellow", "wrong in print": "bold red"}


def run_studies(out: Path | None = None, console: Console | None = None) -> list[Comparison]:
    """Print every comparison by study, and the counts; write them as CSV if asked.

    Args:
        out: CSV file with every comparison; written whole or not at all.
        console: where to print; standard output by default.

    Returns:
        The comparisons.
    """
    console = console or SafeConsole()
    rows = compare_all()
    for study, group in _by_study(rows).items():
        notes = _notes(group)
        console.print(study_table(study, group, notes))
        for note, number in notes.items():
            console.print(f"{number}: {note}", markup=False, highlight=False)
        console.print()
    console.print(counts_table(rows))
    if out is not None:
        write_csv(out, COLUMNS, [_cells(row) for row in rows])
        console.print(f"{len(rows)} comparisons in {out}")
    return rows


def _by_study(rows: Sequence[Comparison]) -> dict[str, list[Comparison]]:
    """The comparisons of each study, studies in the order in which they first appear."""
    studies: dict[str, list[Comparison]] = {}
    for row in rows:
        studies.setdefault(row.study, []).append(row)
    return studies


def _notes(rows: Sequence[Comparison]) -> dict[str, int]:
    """Each note once, numbered from 1."""
    return {note: i for i, note in enumerate(dict.fromkeys(r.note for r in rows if r.note), 1)}


def study_table(study: str, rows: Sequence[Comparison], notes: Mapping[str, int]) -> Table:
    """One study's comparisons as a table for the terminal, as narrow as 80 columns.

    Args:
        study: its name.
        rows: its comparisons.
        notes: numbers of the notes, whose text stands below the table.
    """
    table = Table(title=f"{study}: {_summary(rows)}", title_justify="left", expand=False)
    for name in COLUMNS[1:]:
        right = name in ("printed", "recomputed", "note")
        table.add_column(
            name,
            justify="right" if right else "left",
            no_wrap=name != "quantity",
            overflow="fold",
        )
    for row in rows:
        style = _STYLES[row.verdict]
        _, *cells, verdict, note = _cells(row)
        table.add_row(*cells, Text(verdict, style), str(notes.get(note, "")))
    return table


def counts_table(rows: Sequence[Comparison]) -> Table:
    """Count figures of each study that are equal, rounded and misprinted."""
    table = Table(title="All studies", title_justify="left")
    table.add_column("study")
    for verdict in VERDICTS:
        table.add_column(verdict, justify="right")
    for study, group in _by_study(rows).items():
        table.add_row(study, *_counts(group))
    table.add_section()
    table.add_row("all", *_counts(rows))
    return table


def _counts(rows: Sequence[Comparison]) -> list[str]:
    counts = Counter(row.verdict for row in rows)
    return [str(counts[verdict]) for verdict in VERDICTS]


def _summary(rows: Sequence[Comparison]) -> str:
    numbers = zip(_counts(rows), VERDICTS, strict=True)
    return ", ".join(f"{count} {verdict}" for count, verdict in numbers if count != "0")


def _cells(row: Comparison) -> tuple[str, ...]:
    figure = f"{row.recomputed:.9g}"
    return (row.study, row.table, row.quantity, row.printed, figure, row.verdict, row.note)
