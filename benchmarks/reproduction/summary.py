"""What the terminal shows at the end of a run."""

from pathlib import Path
from statistics import fmean

from rich.console import Console
from rich.table import Table
from rich.text import Text

from benchmarks.reproduction.results import Results
from benchmarks.reproduction.tables import columns
from benchmarks.reproduction.targets import check_targets
from benchmarks.runner.phase_score import PHASES, UNITS

_COLOURS = {"met": "green", "missed": "red", "no figure": "dim"}


def print_summary(results: Results, report: Path, console: Console) -> None:
    """Tables 22 and 30 condensed, the targets, the speed, and where the report is."""
    console.print(_rmse_table(results))
    console.print(_target_table(results))
    print_failures(results, console)
    info = results.info
    console.print(
        f"{info['environment_steps']} environment steps in {info['wall_time_s']:.0f} s with "
        f"{info['jobs']} processes; in one: {info['environment_steps_per_second']:.0f} a second, "
        f"{info['case_steps_per_second']:.0f} with controllers and scoring",
        highlight=False,
    )
    console.print(f"Report: {report}", highlight=False, soft_wrap=True)


def print_failures(results: Results, console: Console) -> None:
    """Why cases failed, if any did: each reason once, with how many and the first of them."""
    if not results.failures:
        return
    console.print(
        f"{len(results.failures)} cases failed, all others are scored:",
        highlight=False,
    )
    for names, reason in results.failure_reasons():
        console.print(f"  {names}: {reason}", markup=False, highlight=False)


def _rmse_table(results: Results) -> Table:
    """RMSE over the pressures of each phase, mean and largest, for everybody."""
    main = results.suite.models[0]
    title = f"RMSE on {main}: mean (largest) over the pressures"
    table = Table("controller", title=title, title_justify="left")
    rows: dict[str, list[str]] = {}
    for task, pressures in results.suite.pressures_kpa.items():
        for phase in PHASES[task]:
            name = "displacement" if task == "displacement" else f"rotation {phase}"
            table.add_column(f"{name}\n({UNITS[task]})", justify="right")
            for who, figures in columns(results, main, task, phase).items():
                known = [score.rmse for p in pressures if (score := figures(p))]
                failed = len(known) < len(pressures)
                cell = "failed" if failed else f"{fmean(known):.3g} ({max(known):.3g})"
                rows.setdefault(who, []).append(cell)
    for who, cells in rows.items():
        table.add_row(who, *cells)
    return table


def _target_table(results: Results) -> Table:
    table = Table("target", title="Targets", title_justify="left")
    for name in ("limit", "this run"):
        table.add_column(name, justify="right")
    table.add_column("verdict")
    for check in check_targets(results):
        got = "—" if check.got is None else f"{check.got:.3g} {check.unit}"
        limit = f"{'<' if check.strict else '≤'} {check.limit:g} {check.unit}"
        table.add_row(check.what, limit, got, Text(check.verdict, _COLOURS[check.verdict]))
    return table
