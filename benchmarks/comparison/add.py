"""`python -m benchmarks add`: somebody's own controller on every suite, beside the others."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from benchmarks.comparison.command_lines import remove_command, run_command
from benchmarks.comparison.scores import print_clipping, print_failures
from benchmarks.executors.executor import run_all
from benchmarks.executors.local import LocalProcesses
from benchmarks.report.leaderboard import read_leaderboard
from benchmarks.report.standings import Standings
from benchmarks.runner.case import BY_LIMIT, Row
from benchmarks.runner.controller_spec import ControllerError, ControllerSpec
from benchmarks.runner.execution import PendingCases, compile_kernels, execute, pending_cases
from benchmarks.runner.provenance import check_folder, run_info, write_run
from benchmarks.runner.run import plain_progress
from benchmarks.runner.user_controller import MAKE_S, probe
from benchmarks.suites.reproduction import ReproductionSuite
from benchmarks.suites.suite import FrozenSuite, SuiteError
from controllers import CONTROLLERS

ENOUGH = 3
"""Cases of a suite that may fail before the rest of it is left: they would fail alike. An end by a
physical limit is a result, and does not count."""

FAILED, INTERRUPTED = 1, 130
"""Exit codes."""


class _EnoughError(Exception):
    """The rest of a suite is not worth running."""


def own_controller(text: str) -> ControllerSpec:
    """The controller of `path/to/file.py:ClassName`, tried in a process of its own.

    Raises:
        ControllerError: it cannot be made, or takes too long to; says why and what to do.
    """
    path, colon, name = text.rpartition(":")
    if not colon or not path or not name:
        raise ControllerError(
            f"name a file and its class as path/to/file.py:ClassName, got {text!r}"
        )
    if name in CONTROLLERS:
        raise ControllerError(f"{name} is a controller of the suites; rename the class in {path}")
    spec = ControllerSpec(name, path=str(Path(path).resolve()))
    if not Path(path).is_file():
        raise ControllerError(f"there is no file {path}; check the name and the folder")
    results: list[object] = []
    process = LocalProcesses(1, MAKE_S, f"importing and making {name}")
    works = [partial(probe, spec)]
    if not run_all(works, process, lambda _, result: results.append(result), untrusted=True):
        raise KeyboardInterrupt
    (result,) = results
    if isinstance(result, ControllerError):
        raise result
    if isinstance(result, BaseException):
        raise ControllerError(f"cannot make {text}: {result}")
    return ControllerSpec(name, str(result), spec.path)


def run_add(
    spec: ControllerSpec, suites: Sequence[FrozenSuite], results: Path, jobs: int, console: Console
) -> int:
    """Score somebody's own controller and say where it stands.

    Args:
        spec: from `own_controller`.
        suites: what to run.
        results: folder with a folder of results for each suite.
        jobs: processes.
        console: where to print.
    Returns:
        Exit code: 0, 1 if a case failed, 130 if it was interrupted.
    Raises:
        SuiteError: a suite without a leaderboard.
    """
    failed = False
    for suite in suites:
        if isinstance(suite, ReproductionSuite):
            raise SuiteError(
                f"suite {suite.name} has a report of its own and no leaderboard; run "
                f"python -m benchmarks --controllers {spec.source}"
            )
        out = results / suite.name
        check_folder(suite, out)
        todo = pending_cases(suite, [suite.entry(spec)], out)
        rows = list(todo.known.values())
        console.print(
            f"{suite.name} version {suite.version}: {len(todo.cases)} cases of "
            f"{spec.label}, {len(rows)} of them done before",
            highlight=False,
        )
        info = run_info(todo, [suite.entry(spec)], out, jobs)
        write_run(out, info, complete=False)
        complete = _run(todo, out, jobs, rows, console)
        write_run(out, info, complete=bool(complete))
        failed |= any(row["failure"] for row in rows)
        print_clipping(rows, console)
        print_failures(rows, console)
        if complete is None:
            console.print(
                f"Interrupted: {len(rows)} of {len(todo.cases)} cases are done and "
                "stay; the same command goes on from there.",
                highlight=False,
            )
            return INTERRUPTED
        if complete:
            _say_ranks(spec, suite, out, console)
    return FAILED if failed else 0


def _run(
    todo: PendingCases, out: Path, jobs: int, rows: list[Row], console: Console
) -> bool | None:
    """Run what is missing, adding to the rows; whether it was worth it to the end.

    Returns:
        True if all is done, False if it failed too often, None if Ctrl-C ended it.
    """
    if not todo.missing:
        return True
    troubles = 0
    with console.status("drawing the stations, compiling their equations"):
        compile_kernels(todo.suite)
    with (
        Progress(console=console, transient=True) as progress,
        plain_progress(console, len(rows), len(todo.cases)) as say,
    ):
        bar = progress.add_task(escape(todo.suite.name), total=len(todo.cases), completed=len(rows))

        def on_done(row: Row) -> None:
            nonlocal troubles
            rows.append(row)
            progress.update(bar, advance=1)
            say(len(rows))
            troubles += bool(row["failure"]) and BY_LIMIT not in row["failure"]
            if troubles >= ENOUGH:
                raise _EnoughError

        try:
            done = execute(todo, LocalProcesses(jobs), out, on_done, untrusted=True)
        except _EnoughError:
            (spec,) = {case.spec for case in todo.cases}
            suite = todo.suite
            console.print(
                f"  {ENOUGH} cases failed: the other {len(todo.cases) - len(rows)} are "
                "not run; correct it and run the same command again, or take its rows out: "
                f"{remove_command(spec.name, suite, out)}",
                highlight=False,
            )
            return False
    return True if done else None


def _say_ranks(spec: ControllerSpec, suite: FrozenSuite, out: Path, console: Console) -> None:
    """Its line in every measure of a suite, beside the other controllers in the folder."""
    leaderboard = read_leaderboard(suite, out)
    for name, standings in leaderboard.standings.items():
        if spec.name in standings.errors.names:
            console.print(f"  {name}: {_line(spec, standings)}", highlight=False)
    others = {name for name, _ in leaderboard.record.rows} - {spec.name}
    if not others:
        console.print(
            f"  no other controller has results in {out} made with this code; for a rank: "
            f"{run_command(suite, out)}",
            highlight=False,
        )


def _line(spec: ControllerSpec, standings: Standings) -> str:
    mine = next(row for row in standings.rows if row.name == spec.name)
    unit = standings.errors.measure.unit
    words = f"{mine.mean.estimate:.3g} {unit} ({mine.mean.low:.3g} to {mine.mean.high:.3g})"
    rivals = len(standings.rivals)
    if mine.rank is not None and rivals > 1:
        words += f", rank {mine.rank} of {rivals}"
    if mine.failures:
        words += f", {mine.failures} cases failed"
    return words
