"""`python -m benchmarks budget`: the error budget of open-loop control, at every pressure."""

from pathlib import Path

from rich.console import Console

from benchmarks.budget.drawn_stations import DRAWN, Contest, contest, drawn_stations
from benchmarks.budget.plots import budget_plot
from benchmarks.budget.tables import (
    BUDGET_COLUMNS,
    DRAWN_COLUMNS,
    Rows,
    alone_rows,
    budget_cells,
    contest_cells,
    contest_rows,
    markdown_table,
    share_rows,
    terminal_table,
    unit_of,
    waterfall_rows,
)
from benchmarks.budget.trial import Budget, trial_budget
from benchmarks.dissertation.profiles import write_csv
from benchmarks.files import write_bytes, write_text
from pma_gym.data.serres2008 import pressures
from pma_gym.terminal import SafeConsole

TASKS = ("displacement", "rotation")


def run_budget(out: Path | None = None, console: Console | None = None) -> dict[str, list[Budget]]:
    """Compute the budgets of all trials, print them, and write them if asked.

    Args:
        out: folder for `budget.csv`, `drawn.csv`, `budget.md` and a picture of each task.
        console: where to print; standard output by default.
    Returns:
        The budgets by task.
    """
    console, drawn = console or SafeConsole(), drawn_stations()
    budgets, contests, text = {}, {}, ["# Error budget of open-loop control"]
    for task in TASKS:
        budgets[task] = [trial_budget(task, pressure) for pressure in pressures(task)]
        contests[task] = [contest(task, pressure, drawn) for pressure in pressures(task)]
        for title, rows in _tables(task, budgets[task], contests[task]):
            console.print(terminal_table(title, rows))
            console.print()
            text += [f"## {title}", markdown_table(rows)]
    if out is not None:
        _write(out, budgets, contests, "\n\n".join(text) + "\n")
        console.print(f"Written: {out}")
    return budgets


def _tables(task: str, budgets: list[Budget], contests: list[Contest]) -> list[tuple[str, Rows]]:
    """Titles and rows of a task's tables."""
    phase, unit = budgets[0].phases[-1], unit_of(task)
    name = task.capitalize()
    return [
        (
            f"{name}: RMSE ({unit}) as causes are taken away in order",
            waterfall_rows(budgets, phase),
        ),
        (f"{name}: change of RMSE ({unit}) by one thing alone", alone_rows(budgets, phase)),
        (f"{name}: share of the mean square (%), over all orders", share_rows(budgets, phase)),
        (f"{name}: RMSE ({unit}) on {DRAWN} drawn stations", contest_rows(contests)),
    ]


def _write(
    out: Path, budgets: dict[str, list[Budget]], contests: dict[str, list[Contest]], text: str
) -> None:
    cells = [row for task in TASKS for row in budget_cells(budgets[task])]
    write_csv(out / "budget.csv", BUDGET_COLUMNS, cells)
    cells = [row for task in TASKS for row in contest_cells(contests[task])]
    write_csv(out / "drawn.csv", DRAWN_COLUMNS, cells)
    write_text(out / "budget.md", text)
    for task in TASKS:
        write_bytes(out / f"{task}.png", budget_plot(budgets[task]))
