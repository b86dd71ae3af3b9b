"""Runs what is missing of a suite's cases with a bar, and goes on where a run stopped."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.executors.executor import Executor
from benchmarks.runner.case import Row
from benchmarks.runner.execution import PendingCases, compile_kernels, execute, pending_cases
from benchmarks.runner.journal import JOURNAL
from benchmarks.runner.provenance import check_folder, run_info, write_run, write_stations
from benchmarks.suites.suite import Entry, FrozenSuite
from pma_gym.cli.progress import StepProgress

FAILED, INTERRUPTED = 1, 130
"""Exit codes."""


class EnoughError(Exception):
    """Raised by `on_row`: the rest of a suite is not worth running."""


@dataclass(frozen=True)
class SuiteRun:
    """A run of a suite into a folder.

    Attributes:
        todo: what was to be run, and what the journal had.
        rows: of all cases that are done, in the order in which they came.
        info: what the run was made with.
        began: `time.perf_counter()` when it began (s).
        complete: whether every case is done.
    """

    todo: PendingCases
    rows: list[Row]
    info: dict[str, Any]
    began: float
    complete: bool

    def finish(self, out: Path) -> None:
        """Write that the run is complete, and how long it took."""
        self.info["wall_time_s"] = time.perf_counter() - self.began
        write_run(out, self.info, complete=True)


def run_missing(
    suite: FrozenSuite,
    entries: Sequence[Entry],
    out: Path,
    executor: Executor,
    console: Console,
    traces: str = "",
    on_row: Callable[[Row], None] = lambda row: None,
    untrusted: bool = False,
) -> SuiteRun:
    """Run what a folder's journal lacks of a suite.

    Args:
        suite: the suite.
        entries: controllers to run.
        out: folder of the results; made if need be.
        executor: where the cases run.
        console: where to print.
        traces: form of the time series that are written too; none if empty.
        on_row: called with each new row; may raise `EnoughError`, which ends the run.
        untrusted: run no case twice, see `run_all`.
    Returns:
        The run; Ctrl-C ends it early, says so, and what is done stays in the journal.
    Raises:
        SuiteError: the folder has another suite's results.
    """
    began = time.perf_counter()
    check_folder(suite, out)
    todo = pending_cases(suite, entries, out, traces)
    console.print(_greeting(todo, entries, out, executor.jobs), highlight=False)
    info = run_info(todo, entries, out, executor.jobs)
    write_run(out, info, complete=False)
    rows = list(todo.known.values())
    run = SuiteRun(todo, rows, info, began, complete=False)
    try:
        if _run(run, entries, out, executor, console, on_row, untrusted):
            return replace(run, complete=True)
    except EnoughError:
        return run
    except KeyboardInterrupt:
        pass
    say_interrupted(run, out, console)
    return run


def say_interrupted(run: SuiteRun, out: Path, console: Console) -> None:
    """Say how much is done, and how it goes on."""
    console.print(
        f"Interrupted: {len(run.rows)} of {len(run.todo.cases)} cases are done and stay in "
        f"{out / JOURNAL}. The same command goes on from there.",
        highlight=False,
    )


def _run(
    run: SuiteRun,
    entries: Sequence[Entry],
    out: Path,
    executor: Executor,
    console: Console,
    on_row: Callable[[Row], None],
    untrusted: bool,
) -> bool:
    """Run what is missing; adds to the rows."""
    todo, rows = run.todo, run.rows
    if not todo.missing:
        return True
    with console.status("drawing the stations, compiling their equations"):
        write_stations(out, todo.suite)
        compile_kernels(todo.suite)
    with (
        _progress(console) as progress,
        plain_progress(console, len(rows), len(todo.cases)) as say,
    ):
        advance = _bars(progress, todo, entries)

        def on_done(row: Row) -> None:
            rows.append(row)
            advance(row)
            say(len(rows))
            on_row(row)

        return execute(todo, executor, out, on_done, untrusted)


@contextmanager
def plain_progress(console: Console, done: int, total: int) -> Iterator[Callable[[int], None]]:
    """Print how many cases are done, a line a minute, where no bar can be drawn.

    Args:
        console: where the bars go; on a terminal nothing is printed.
        done: cases that were done before.
        total: cases in all.
    Yields:
        What to call with the number of cases that are done.
    """
    with StepProgress() if not console.is_terminal else nullcontext() as progress:
        show = progress or (lambda step, done, total: None)
        show("running cases", done, total)
        yield lambda count: show("running cases", count, total)


def _greeting(todo: PendingCases, entries: Sequence[Entry], out: Path, jobs: int) -> str:
    suite, done = todo.suite, len(todo.known)
    text = (
        f"Suite {suite.name} version {suite.version}: {len(suite.stations)} stations, "
        f"{len(suite.episodes)} episodes, {len(entries)} controllers: {len(todo.cases)} cases, "
        f"{jobs} at a time"
    )
    if done:
        text += f"\n{done} cases are done in {out / JOURNAL} and used again"
    if todo.outdated:
        text += (
            f"\n{todo.outdated} rows in {out / JOURNAL} were made with other options, other "
            "code or another file of these controllers; they stay there, are not used, and their "
            "cases run anew. The report in this folder is replaced; --out names another folder"
        )
    return text


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failed]}", markup=False),
        console=console,
    )


def _bars(
    progress: Progress, todo: PendingCases, entries: Sequence[Entry]
) -> Callable[[Row], None]:
    """A bar for each controller and one for all, which rows move on."""
    counts = Counter(case.spec.name for case in todo.cases)
    done = Counter(name for name, _ in todo.known)
    failures = Counter[str]()
    bars = {
        entry.spec.name: progress.add_task(
            entry.spec.label,
            total=counts[entry.spec.name],
            completed=done[entry.spec.name],
            failed="",
        )
        for entry in entries
    }
    whole = progress.add_task("all", total=len(todo.cases), completed=len(todo.known), failed="")

    def advance(row: Row) -> None:
        name = row["controller"]
        failures[name] += bool(row["failure"])
        text = f"{failures[name]} failed" if failures[name] else ""
        progress.update(bars[name], advance=1, failed=text)
        progress.update(whole, advance=1)

    return advance
