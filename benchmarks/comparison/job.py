"""`python -m benchmarks run`: compare controllers on a frozen suite, and go on where it stopped.

`python -m benchmarks suites`: what can be run.

`python -m benchmarks remove`: take a controller's rows out of journals; all others stay.
"""

import difflib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.comparison.add import print_scores, write_scores
from benchmarks.executors.executor import Executor
from benchmarks.report.leaderboard import keep_bounds, report_command
from benchmarks.rigs.suite import joint_suite
from benchmarks.runner.case import cases
from benchmarks.runner.controller_spec import ControllerError, parse_controllers
from benchmarks.runner.journal import JOURNAL, rewrite
from benchmarks.runner.provenance import read_run, write_run
from benchmarks.runner.run import FAILED, INTERRUPTED, run_missing
from benchmarks.suites.frozen import frozen_suite, suite_names
from benchmarks.suites.suite import Entry, FrozenSuite, SuiteError
from pma_gym.cli.terminal import terminal_table
from pma_gym.pages.document import TextTable


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


def print_suites(console: Console) -> None:
    """A table of the suites and of who is compared on them."""
    documents = suite_documents()
    header = ("name", "version", "stations", "episodes", "cases")
    rows = [[*(str(each[name]) for name in header), str(len(each["tasks"]))] for each in documents]
    console.print(terminal_table(TextTable("", ("suite", *header[1:], "tasks"), rows)))
    for each in documents:
        console.print(f"{each['name']}: {each['title']} ({each['loop']})", highlight=False)
        console.print(f"  tasks: {', '.join(each['tasks'])}", highlight=False)
        console.print(f"  controllers: {', '.join(each['controllers'])}", highlight=False)


def suite_documents() -> list[dict[str, Any]]:
    """The frozen suites for programs: version, size, tasks, controllers and control loop."""
    documents = [
        {
            "name": suite.name,
            "version": suite.version,
            "title": suite.title,
            "stations": len(suite.stations),
            "episodes": len(suite.episodes),
            "cases": len(cases(suite, suite.entries)),
            "tasks": list(suite.tasks),
            "controllers": [entry.spec.name for entry in suite.entries],
            "control_rate_hz": suite.control_rate_hz,
            "loop": _control(suite),
        }
        for suite in map(frozen_suite, suite_names())
    ]
    return [*documents, joint_suite().summary()]


def _control(suite: FrozenSuite) -> str:
    """Rate and delays, for people."""
    parts = [f"{suite.control_rate_hz:g} Hz"]
    for name, what in (("action_delay_s", "commands"), ("observation_delay_s", "readings")):
        delay = suite.environment.get(name, 0.0)
        parts += [f"{what} {1e3 * delay:g} ms late"] if delay else []
    return ", ".join(parts)


def remove_controller(name: str, suites: Sequence[FrozenSuite], results: Path) -> dict[Path, int]:
    """Take a controller out of the results of suites.

    Each journal is replaced as a whole by one in which every other line has the same bytes, damaged
    lines included; what `run.json` says of the controller goes too. Pages stay until `report`.

    Args:
        name: of the controller, as the journal has it.
        suites: whose folders are looked at.
        results: folder with a folder of results for each suite.
    Returns:
        How many rows were taken out of each journal that had some.
    Raises:
        SuiteError: no journal has any, or a run is writing to one.
    """
    journals = [results / suite.name / JOURNAL for suite in suites]
    known = {path: _names(path) for path in journals if path.is_file()}
    if not any(name in names for names in known.values()):
        raise SuiteError(_unknown(name, known, results))
    return {path: _removed(name, path) for path, names in known.items() if name in names}


def _removed(name: str, path: Path) -> int:
    count = rewrite(path, lambda line: _controller(line) != name)
    info = read_run(path.parent)
    specs = info.get("contenders")
    if isinstance(specs, dict) and name in specs:
        rest = {each: entry for each, entry in specs.items() if each != name}
        write_run(path.parent, info, contenders=rest)
    return count


def _controller(line: bytes) -> str | None:
    """Whose row a line is; None for a damaged one."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    name = row.get("controller") if isinstance(row, dict) else None
    return name if isinstance(name, str) else None


def _names(path: Path) -> set[str]:
    with path.open("rb") as lines:
        return {name for line in lines if (name := _controller(line)) is not None}


def _unknown(name: str, known: dict[Path, set[str]], results: Path) -> str:
    every = sorted(set().union(*known.values()))
    if not every:
        return f"{results} has no journal of these suites; name the folder by --results"
    near = difflib.get_close_matches(name, every, 1)
    hint = f"; did you mean {near[0]}?" if near else ""
    where = ", ".join(map(str, known))
    return f"no rows of {name!r} in {where}; they have rows of {', '.join(every)}{hint}"
