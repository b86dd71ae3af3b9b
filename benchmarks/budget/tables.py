"""The budget as tables: for the terminal, as Markdown and as CSV."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from rich.table import Table

from benchmarks.budget.drawn_stations import CONTROLLERS, Contest
from benchmarks.budget.trial import Budget
from pma_gym.tasks import TASKS

Rows = list[list[str]]
"""Cells of a table, the first row its header."""

BUDGET_COLUMNS = (
    *("task", "pressure_kpa", "phase", "unit", "kind", "name"),
    *("rmse", "rmse_change", "rmse_alone", "rmse_alone_change", "mean_square_share"),
)
"""Columns of the CSV file of budgets. `rmse` of a cause is that after it and all causes above it
are taken away, `rmse_alone` that without it alone; shares are in the unit squared."""

DRAWN_COLUMNS = (
    *("task", "pressure_kpa", "unit", "controller"),
    *("nominal_rmse", "median_rmse", "worst_rmse", "better_on"),
)
"""Columns of the CSV file of the drawn stations; RMSE over all phases."""


def unit_of(task: str) -> str:
    """Unit of a task's errors: mm or deg."""
    return TASKS[task].schedule.unit


def waterfall_rows(budgets: Sequence[Budget], phase: str) -> Rows:
    """RMSE as causes are taken away one after the other: rows causes, columns pressures."""
    falls = [budget.waterfall(phase) for budget in budgets]
    rows = [
        _header(budgets),
        ["measured by Serres", *(f"{budget.measured[phase]:.2f}" for budget in budgets)],
        ["printed voltages", *(f"{fall[0]:.2f}" for fall in falls)],
    ]
    for k, cause in enumerate(budgets[0].causes):
        rows.append([f"less {cause}", *(_short(fall[k + 1]) for fall in falls)])
    rows.append(["improved feed-forward", *(_short(b.improved[phase]) for b in budgets)])
    return rows


def alone_rows(budgets: Sequence[Budget], phase: str) -> Rows:
    """Tabulate the change of RMSE when a single cause is removed or changed."""

    def change(value: Callable[[Budget], float]) -> list[str]:
        return [_signed(value(b) - b.printed[phase]) for b in budgets]

    rows = [_header(budgets)]
    for cause in budgets[0].causes:
        rows.append([f"without {cause}", *change(lambda b, c=cause: b.alone(c, phase))])
    for variant in budgets[0].variants:
        rows.append([variant, *change(lambda b, v=variant: b.variants[v][phase])])
    return rows


def share_rows(budgets: Sequence[Budget], phase: str) -> Rows:
    """Shares of the mean square error in percent, the mean over all orders of taking away."""
    rows = [_header(budgets)]
    for cause in budgets[0].causes:
        shares = [100.0 * b.share(cause, phase) / b.printed[phase] ** 2 for b in budgets]
        rows.append([cause, *(f"{share:.1f}" for share in shares)])
    return rows


def contest_rows(contests: Sequence[Contest]) -> Rows:
    """Both feed-forwards on the nominal station and on the drawn ones."""
    rows = [["RMSE", *(f"{contest.pressure_kpa:g}" for contest in contests)]]
    for name, label in zip(CONTROLLERS, ("Serres", "improved"), strict=True):
        rows.append([f"{label}, nominal", *(_short(c.nominal[name]) for c in contests)])
        rows.append([f"{label}, median", *(f"{np.median(c.drawn[name]):.2f}" for c in contests)])
        rows.append([f"{label}, worst", *(f"{np.max(c.drawn[name]):.2f}" for c in contests)])
    count = len(contests[0].drawn[CONTROLLERS[0]])
    rows.append([f"improved better, of {count}", *(str(c.better) for c in contests)])
    return rows


def terminal_table(title: str, rows: Rows) -> Table:
    """Rows as a table for the terminal, as narrow as 80 columns."""
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for i, name in enumerate(rows[0]):
        table.add_column(name, justify="right" if i else "left", no_wrap=True)
    for row in rows[1:]:
        table.add_row(*row)
    return table


def markdown_table(rows: Rows) -> str:
    """Rows as a table in Markdown."""
    rule = ["---", *("--:" for _ in rows[0][1:])]
    return "\n".join(f"| {' | '.join(row)} |" for row in (rows[0], rule, *rows[1:]))


def budget_cells(budgets: Sequence[Budget]) -> Iterator[tuple[str, ...]]:
    """All figures of the budgets, a row each, as `BUDGET_COLUMNS`."""
    for budget in budgets:
        for phase in budget.phases:
            place = (budget.task, f"{budget.pressure_kpa:g}", phase, unit_of(budget.task))
            yield from ((*place, *cells) for cells in _phase_cells(budget, phase))


def _phase_cells(budget: Budget, phase: str) -> Iterator[tuple[str, ...]]:
    fall, printed = budget.waterfall(phase), budget.printed[phase]
    yield ("whole", "measured", _number(budget.measured[phase]), "", "", "", "")
    yield ("whole", "printed", _number(printed), "", "", "", "")
    for k, cause in enumerate(budget.causes):
        alone = budget.alone(cause, phase)
        figures = (
            *(fall[k + 1], fall[k + 1] - fall[k]),
            *(alone, alone - printed, budget.share(cause, phase)),
        )
        yield ("cause", cause, *map(_number, figures))
    rest = budget.improved[phase] - fall[-1]
    yield ("whole", "improved", *map(_number, (budget.improved[phase], rest)), "", "", "")
    for name, errors in budget.variants.items():
        figures = errors[phase], errors[phase] - printed
        yield ("variant", name, "", "", *map(_number, figures), "")


def contest_cells(contests: Sequence[Contest]) -> Iterator[tuple[str, ...]]:
    """All figures of the contests, a row each, as `DRAWN_COLUMNS`."""
    for contest in contests:
        for name in CONTROLLERS:
            drawn = contest.drawn[name]
            figures = contest.nominal[name], float(np.median(drawn)), float(np.max(drawn))
            wins = contest.better if name == CONTROLLERS[1] else len(drawn) - contest.better
            place = (contest.task, f"{contest.pressure_kpa:g}", unit_of(contest.task), name)
            yield (*place, *map(_number, figures), str(wins))


def _header(budgets: Sequence[Budget]) -> list[str]:
    return ["kPa", *(f"{budget.pressure_kpa:g}" for budget in budgets)]


def _short(value: float) -> str:
    """Two digits after the point, three below 0.1."""
    return f"{value:.3f}" if value < 0.0995 else f"{value:.2f}"


def _signed(value: float) -> str:
    """Two digits after the point, without a sign where they are zeros."""
    return f"{value:+.2f}" if abs(value) >= 0.005 else "0.00"


def _number(value: float) -> str:
    return f"{value:.5g}"
