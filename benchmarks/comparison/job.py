"""`python -m benchmarks run`: compare controllers on a frozen suite, and go on where it stopped."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.comparison.command_lines import report_command
from benchmarks.comparison.scores import print_scores, write_scores
from benchmarks.executors.executor import Executor
from benchmarks.report.leaderboard import keep_bounds
from benchmarks.runner.controller_spec import ControllerError, parse_controllers
from benchmarks.runner.run import FAILED, INTERRUPTED, run_missing
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import Entry, FrozenSuite


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
    suite: FrozenSuite,
    entries: Sequence[Entry],
    out: Path,
    executor: Executor,
    console: Console,
    traces: str = "",
) -> int:
    """Run what is missing of a suite and write its scores.

    Args:
        suite: the suite, or a part of it.
        entries: controllers to run.
        out: folder of the results; made if need be.
        executor: where the cases run.
        console: where to print.
        traces: form of the time series that are written too; none if empty.
    Returns:
        Exit code: 0, 1 if a case failed, 130 if it was interrupted.
    Raises:
        SuiteError: the folder has another suite's results.
    """
    run = run_missing(suite, entries, out, executor, console, traces)
    if not run.complete:
        return INTERRUPTED
    write_scores(out, run.todo, run.rows)
    run.finish(out)
    print_scores(run.todo, entries, run.rows, console)
    try:
        with console.status("computing the achievable bounds that the leaderboard needs"):
            keep_bounds(frozen_suite(suite.source), out)
    except KeyboardInterrupt:
        console.print("Interrupted: all cases are done; the report computes the bounds.")
    console.print(f"Leaderboard: {report_command(suite, out)}", highlight=False)
    return FAILED if any(row["failure"] for row in run.rows) else 0
