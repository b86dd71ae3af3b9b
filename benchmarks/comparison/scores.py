"""A run's scores: a table of all cases as a file, and a few figures on the terminal."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from rich.console import Console
from rich.table import Table

from benchmarks.executors.failures import ProcessDied, TookTooLong
from benchmarks.files import write_text
from benchmarks.runner.case import BY_LIMIT, Row
from benchmarks.runner.controller_spec import ControllerError
from benchmarks.runner.execution import PendingCases, identity, row_identity
from benchmarks.runner.user_controller import LateError
from benchmarks.suites.suite import Entry

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
    write_text(out / SCORES, csv_text(todo, rows))


def csv_text(todo: PendingCases, rows: Sequence[Row]) -> str:
    """A row for each case that is done."""
    by_case = {row_identity(row): row for row in rows}
    ordered = [by_case[its] for case in todo.cases if (its := identity(case)) in by_case]
    phases = list(dict.fromkeys(name for row in ordered for name in row.get("phases", ())))
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*WHO, *FIGURES, *(f"rmse_{name}" for name in phases), *TIMES])
    for row in ordered:
        each = row.get("phases", {})
        by_phase = [each[name]["rmse"] if name in each else "" for name in phases]
        known, times = ([row.get(name, "") for name in names] for names in (FIGURES, TIMES))
        writer.writerow([*(row.get(name, "") for name in WHO), *known, *by_phase, *times])
    return out.getvalue()


def print_scores(
    todo: PendingCases, entries: Sequence[Entry], rows: Sequence[Row], console: Console
) -> None:
    """Median RMSE of every controller, and why cases failed."""
    units = list(dict.fromkeys(row["unit"] for row in rows if not row["failure"]))
    table = Table("controller", title=f"Suite {todo.suite.name}", title_justify="left")
    for heading in ("cases", "failed", *(f"median RMSE ({unit})" for unit in units), "act (us)"):
        table.add_column(heading, justify="right")
    for entry in entries:
        mine = [row for row in rows if row["controller"] == entry.spec.name]
        done = [row for row in mine if not row["failure"]]
        errors = [[row["rmse"] for row in done if row["unit"] == unit] for unit in units]
        table.add_row(
            entry.spec.label,
            str(len(mine)),
            str(len(mine) - len(done)),
            *(_figure(values) for values in errors),
            _figure([row["act_us"] for row in done]),
        )
    console.print(table)
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
