"""`python -m benchmarks add`: somebody's own controller on every suite, beside the others.

A run's scores: a table of all cases as a file, and a few figures on the terminal.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from statistics import median

from rich.console import Console

from benchmarks.executors.executor import ProcessDied, TookTooLong, run_all
from benchmarks.executors.local import LocalProcesses
from benchmarks.files import csv_text, write_text
from benchmarks.report.leaderboard import read_leaderboard, remove_command, run_command
from benchmarks.report.standings import Standings
from benchmarks.runner.case import BY_LIMIT, Row
from benchmarks.runner.controller_spec import ControllerError, ControllerSpec
from benchmarks.runner.execution import (
    PendingCases,
    identity,
    row_identity,
)
from benchmarks.runner.isolated_controller import MAKE_S, LateError, probe
from benchmarks.runner.run import EnoughError, run_missing
from benchmarks.suites.reproduction import ReproductionSuite
from benchmarks.suites.suite import Entry, FrozenSuite, SuiteError
from controllers import CONTROLLERS
from pma_gym.cli.terminal import terminal_table
from pma_gym.pages.document import TextTable

SCORES = "scores.csv"

MOST_REASONS = 10
"""How many reasons of failures the terminal shows."""

WHO = (
    *("suite", "version", "controller", "station", "task", "pressure_kpa", "repeat", "seed"),
    *("failure", "unit"),
)
FIGURES = (
    *("rmse", "start_rmse", "steady_rmse", "effort_v", "variation_v_per_s"),
    *("saturation_share", "violation", "clipped_share", "clipped_v"),
)
TIMES = ("act_us", "act_us_worst")
"""Columns of scores.csv: a row a case, errors in its unit; the RMSE of every phase stands between
figures and times. All but the times are the same bits in every run."""


def write_scores(out: Path, todo: PendingCases, rows: Sequence[Row]) -> None:
    """Write `scores.csv`, in the order of the plan's cases."""
    write_text(out / SCORES, scores_text(todo, rows))


def scores_text(todo: PendingCases, rows: Sequence[Row]) -> str:
    """A row for each case that is done."""
    by_case = {row_identity(row): row for row in rows}
    ordered = [by_case[its] for case in todo.cases if (its := identity(case)) in by_case]
    phases = list(dict.fromkeys(name for row in ordered for name in row.get("phases", ())))
    cells = [[*WHO, *FIGURES, *(f"rmse_{name}" for name in phases), *TIMES]]
    for row in ordered:
        each = row.get("phases", {})
        by_phase = [each[name]["rmse"] if name in each else "" for name in phases]
        known, times = ([row.get(name, "") for name in names] for names in (FIGURES, TIMES))
        cells.append([*(row.get(name, "") for name in WHO), *known, *by_phase, *times])
    return csv_text(cells)


def print_scores(
    todo: PendingCases, entries: Sequence[Entry], rows: Sequence[Row], console: Console
) -> None:
    """Median RMSE of every controller, and why cases failed."""
    units = list(dict.fromkeys(row["unit"] for row in rows if not row["failure"]))
    cells = []
    for entry in entries:
        mine = [row for row in rows if row["controller"] == entry.spec.name]
        done = [row for row in mine if not row["failure"]]
        errors = [[row["rmse"] for row in done if row["unit"] == unit] for unit in units]
        figures = map(_figure, [*errors, [row["act_us"] for row in done]])
        cells.append([entry.spec.label, str(len(mine)), str(len(mine) - len(done)), *figures])
    medians = (f"median RMSE ({unit})" for unit in units)
    header = ["controller", "cases", "failed", *medians, "act (us)"]
    console.print(terminal_table(TextTable(f"Suite {todo.suite.name}", header, cells)))
    print_clipping(rows, console)
    print_failures(rows, console)


def print_clipping(rows: Sequence[Row], console: Console) -> None:
    """Whose commands were clipped to 0-10 V: how often, in how many cases, by how much."""
    for name in dict.fromkeys(row["controller"] for row in rows):
        mine = [row for row in rows if row["controller"] == name and "clipped_share" in row]
        clipped = [row for row in mine if row["clipped_share"] > 0.0]
        if clipped:
            share = 100.0 * sum(row["clipped_share"] for row in mine) / len(mine)
            most = max(row["clipped_v"] for row in clipped)
            console.print(
                f"  {name}: {share:.2g} % of its commands were below 0 V or above 10 V, by up to "
                f"{most:.3g} V, in {len(clipped)} of {len(mine)} cases; clipped to 0-10 V",
                markup=False,
                highlight=False,
            )


def print_failures(rows: Sequence[Row], console: Console) -> None:
    """Print why cases failed: each reason once, the commonest first."""
    reasons = sorted(failures(rows).items(), key=lambda item: -len(item[1]))
    for reason, names in reasons[:MOST_REASONS]:
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        console.print(f"  {names[0]}{more}: {reason}", markup=False, highlight=False)
    if len(reasons) > MOST_REASONS:
        console.print(f"  and {len(reasons) - MOST_REASONS} other reasons, see the journal")


def failures(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Names of the cases that failed, by reason; ends by one limit are one, whenever they came."""
    reasons: dict[str, list[str]] = {}
    for row in rows:
        if row["failure"]:
            controller, episode = row_identity(row)
            _, early, limit = row["failure"].partition(BY_LIMIT)
            reason = f"ended {early}{limit}" if early else _without_kind(row["failure"])
            reasons.setdefault(reason, []).append(f"{controller}/{episode.name}")
    return reasons


def _without_kind(failure: str) -> str:
    """A failure without the kind of exception that told it, where its words say enough."""
    for kind in (ControllerError, LateError, ProcessDied, TookTooLong):
        failure = failure.removeprefix(f"{kind.__name__}: ")
    return failure


def _figure(values: Sequence[float]) -> str:
    return f"{median(values):.3g}" if values else "-"


ENOUGH = 3
"""Cases of a suite that may fail before the rest of it is left: they would fail alike. An end by a
physical limit is a result, and does not count."""

FAILED, INTERRUPTED = 1, 130
"""Exit codes."""


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
        out, troubles = results / suite.name, list[Row]()

        def on_row(row: Row, troubles: list[Row] = troubles) -> None:
            if row["failure"] and BY_LIMIT not in row["failure"]:
                troubles.append(row)
            if len(troubles) >= ENOUGH:
                raise EnoughError

        places, entries = LocalProcesses(jobs), [suite.entry(spec)]
        run = run_missing(suite, entries, out, places, console, "", on_row, untrusted=True)
        if run.complete:
            run.finish(out)
        failed |= any(row["failure"] for row in run.rows)
        print_clipping(run.rows, console)
        print_failures(run.rows, console)
        if run.complete:
            _say_ranks(spec, suite, out, console)
        elif len(troubles) < ENOUGH:
            return INTERRUPTED
        else:
            console.print(
                f"  {ENOUGH} cases failed: the other {len(run.todo.cases) - len(run.rows)} are "
                "not run; correct it and run the same command again, or take its rows out: "
                f"{remove_command(spec.name, suite, out)}",
                highlight=False,
            )
    return FAILED if failed else 0


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
    text = f"{mine.mean.estimate:.3g} {unit} ({mine.mean.low:.3g} to {mine.mean.high:.3g})"
    rivals = len(standings.rivals)
    if mine.rank is not None and rivals > 1:
        text += f", rank {mine.rank} of {rivals}"
    if mine.failures:
        text += f", {mine.failures} cases failed"
    return text
