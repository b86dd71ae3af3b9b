"""`python -m benchmarks run`: compare controllers on a frozen suite, and go on where it stopped."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.comparison.command_lines import report_command
from benchmarks.comparison.scores import print_scores, write_scores
from benchmarks.executors.executor import Executor
from benchmarks.report.leaderboard import keep_bounds
from benchmarks.runner.case import Row
from benchmarks.runner.controller_spec import ControllerError, parse_controllers
from benchmarks.runner.execution import PendingCases, compile_kernels, execute, pending_cases
from benchmarks.runner.journal import JOURNAL
from benchmarks.runner.provenance import check_folder, run_info, write_run, write_stations
from benchmarks.suites.frozen import Entry, FrozenSuite

FAILED, INTERRUPTED = 1, 130
"""Exit codes."""


def chosen(suite: FrozenSuite, controllers: str) -> list[Entry]:
    """Entries of a list as the command line has it: names, files with a class, or `all`.

    Raises:
        ControllerError: one that cannot be made, or two of one name.
    """
    if controllers.strip() in ("", "all"):
        return list(suite.entries)
    known = [entry.spec for entry in suite.entries]
    entries = [suite.entry(spec) for spec in parse_controllers(controllers, known)]
    by_name: dict[str, Entry] = {}
    for entry in entries:
        rival = by_name.setdefault(entry.spec.name, entry).spec
        if rival.source != entry.spec.source:
            raise ControllerError(
                f"two controllers are called {rival.name}: {rival.source} and "
                f"{entry.spec.source}; rename one class"
            )
    return list(by_name.values())


def run_comparison(
    suite: FrozenSuite, entries: Sequence[Entry], out: Path, executor: Executor, console: Console
) -> int:
    """Run what is missing of a suite and write its scores.

    Args:
        suite: the suite.
        entries: controllers to run.
        out: folder of the results; made if need be.
        executor: where the cases run.
        console: where to print.
    Returns:
        Exit code: 0, 1 if a case failed, 130 if it was interrupted.
    Raises:
        SuiteError: the folder has another suite's results.
    """
    began = time.perf_counter()
    check_folder(suite, out)
    todo = pending_cases(suite, entries, out)
    console.print(_greeting(todo, entries, out, executor.jobs), highlight=False)
    info = run_info(todo, entries, out, executor.jobs)
    write_run(out, info, complete=False)
    rows = list(todo.known.values())
    try:
        complete = _run(todo, entries, out, executor, rows, console)
    except KeyboardInterrupt:
        complete = False
    finally:
        info["wall_time_s"] = time.perf_counter() - began
    if not complete:
        return _leave(todo, rows, out, console)
    write_scores(out, todo, rows)
    write_run(out, info, complete=True)
    print_scores(todo, entries, rows, console)
    try:
        with console.status("computing the achievable bounds that the leaderboard needs"):
            keep_bounds(suite, out)
    except KeyboardInterrupt:
        console.print("[yellow]Interrupted:[/] all cases are done; the report computes the bounds.")
    console.print(f"Leaderboard: {report_command(suite, out)}", highlight=False)
    return FAILED if any(row["failure"] for row in rows) else 0


def _run(
    todo: PendingCases,
    entries: Sequence[Entry],
    out: Path,
    executor: Executor,
    rows: list[Row],
    console: Console,
) -> bool:
    """Run what is missing; adds to the rows."""
    if not todo.missing:
        return True
    with console.status("drawing the stations, compiling their equations"):
        write_stations(out, todo.suite)
        compile_kernels(todo.suite)
    with _progress(console) as progress:
        advance = _bars(progress, todo, entries)

        def on_done(row: Row) -> None:
            rows.append(row)
            advance(row)

        return execute(todo, executor, out, on_done)


def _greeting(todo: PendingCases, entries: Sequence[Entry], out: Path, jobs: int) -> str:
    suite, done = todo.suite, len(todo.known)
    words = (
        f"Suite {suite.name} version {suite.version}: {len(suite.stations)} stations, "
        f"{len(suite.episodes)} episodes, {len(entries)} controllers: {len(todo.cases)} cases, "
        f"{jobs} at a time"
    )
    if done:
        words += f"\n{done} cases are done in {out / JOURNAL} and used again"
    if todo.outdated:
        words += (
            f"\n{todo.outdated} rows there were made with other code, another version or another "
            "file of these controllers; they stay there, are not used, and their cases run anew"
        )
    return words


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
    wanted = Counter(case.spec.name for case in todo.cases)
    done = Counter(name for name, _ in todo.known)
    failures = Counter[str]()
    bars = {
        entry.spec.name: progress.add_task(
            entry.spec.label,
            total=wanted[entry.spec.name],
            completed=done[entry.spec.name],
            failed="",
        )
        for entry in entries
    }
    whole = progress.add_task("all", total=len(todo.cases), completed=len(todo.known), failed="")

    def advance(row: Row) -> None:
        name = row["controller"]
        failures[name] += bool(row["failure"])
        words = f"{failures[name]} failed" if failures[name] else ""
        progress.update(bars[name], advance=1, failed=words)
        progress.update(whole, advance=1)

    return advance


def _leave(todo: PendingCases, rows: Sequence[Row], out: Path, console: Console) -> int:
    console.print(
        f"Interrupted: {len(rows)} of {len(todo.cases)} cases are done and stay in "
        f"{out / JOURNAL}. The same command goes on from there.",
        highlight=False,
    )
    return INTERRUPTED
