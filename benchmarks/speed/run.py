"""The command `speed`: measure, print, write, judge."""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from benchmarks.files import write_text
from benchmarks.speed.measure import QUICK, Measurement, Repetition
from benchmarks.speed.report.document import Document, document, started
from benchmarks.speed.report.ratios import (
    CHECKS,
    TARGETS,
    Target,
    Verdict,
    judge_all,
    neighbours,
    wanted_rows,
)
from benchmarks.speed.report.tables import SpeedTable, rate, speed_tables
from benchmarks.speed.rows import RequestError, Row, all_rows, select
from pma_gym.files import OutputError, check_output
from pma_gym.terminal import SafeConsole

DONE, FAILED, INTERRUPTED = 0, 1, 130
"""Exit codes."""

WIDTH = 120
"""Characters of a line where there is no terminal."""


def run_speed(
    json_file: Path | None = None,
    check: bool = False,
    only: str = "",
    quick: bool = False,
    console: Console | None = None,
) -> int:
    """Measure this package beside what is installed of others.

    Args:
        json_file: file for all figures, if any.
        check: measure only what shows a loss of vectorisation, and judge it.
        only: patterns of rows by commas; all if empty.
        quick: a smoke run, whose figures say little.
        console: where to print; the terminal if not given.
    Returns:
        Exit code: 0, 1 if a check failed, 130 if the run was interrupted.
    Raises:
        RequestError: the file cannot be written, or a pattern matches no row.
    """
    if json_file is not None:
        _check(json_file)
    # A file or a pipe has no width of its own.
    console = console or (SafeConsole() if sys.stdout.isatty() else SafeConsole(width=WIDTH))
    if quick:
        console.print("A smoke run: it shows that all works, its figures say little.")
    targets = CHECKS if check else TARGETS
    rows = chosen_rows(targets if check else (), only)
    together = neighbours(targets, [row.key for row in rows])
    measurement = Measurement(rows, QUICK if quick else Repetition(), together=together)
    info, begin = started(), time.perf_counter()
    try:
        _measure(measurement, console)
    except KeyboardInterrupt:
        console.print("Interrupted: what follows is what was measured so far.")
    verdicts = judge_all(targets, measurement.rows)
    report = document(measurement, verdicts, info, time.perf_counter() - begin)
    for table in speed_tables(report):
        console.print(_table(table))
    if json_file is not None:
        _write(report, json_file, console)
    if not measurement.complete:
        return INTERRUPTED
    return _checked(verdicts, console) if check else DONE


def chosen_rows(targets: Sequence[Target], only: str) -> list[Row]:
    """The rows that targets compare, or all if there are none, further chosen by patterns."""
    rows = all_rows()
    if targets:
        keys = set(wanted_rows(targets, [row.key for row in rows]))
        rows = [row for row in rows if row.key in keys]
    return select(only, rows)


def partial_file(json_file: Path) -> Path:
    """Return the file of an interrupted run: beside the last whole run, never over it."""
    return json_file.with_name(f"{json_file.stem}.partial.json")


def _check(json_file: Path) -> None:
    try:
        check_output(json_file)
        check_output(partial_file(json_file))
    except OutputError as error:
        raise RequestError(f"--json: {error}") from None


def _measure(measurement: Measurement, console: Console) -> None:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[last]}", markup=False),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("measuring", total=measurement.work, last="")
        measurement.run(lambda title: progress.update(bar, advance=1, last=title))


def _write(report: Document, json_file: Path, console: Console) -> None:
    path = json_file if report["complete"] else partial_file(json_file)
    write_text(path, json.dumps(report, indent=1) + "\n")
    console.print(f"Written to {path}", highlight=False)


def _checked(verdicts: Sequence[Verdict], console: Console) -> int:
    """Exit code of a check: what could not be measured does not count as passed."""
    failed = [v for v in verdicts if v.word == "missed" or (v.got is None and not v.excused)]
    for verdict in failed:
        print(f"failed: {_sentence(verdict)}", file=sys.stderr)
    if not failed:
        console.print("The check passed: batches are computed in lanes and on all threads.")
    return FAILED if failed else DONE


def _sentence(verdict: Verdict) -> str:
    target = verdict.target
    if verdict.got is None:
        return f"{target.title}: not measured: {verdict.absence}"
    return f"{target.title}: {rate(verdict.got[1])}, at least {rate(target.limit)} wanted"


def _table(content: SpeedTable) -> Table:
    table = Table(title=content.title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for number, name in enumerate(content.header):
        words = number < content.words
        table.add_column(name, justify="left" if words else "right", no_wrap=not words)
    for row in content.rows:
        table.add_row(*row)
    return table
