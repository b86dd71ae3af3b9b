"""The leaderboard's tables as text."""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from benchmarks.report.errors import PERCENT, SuiteRecord
from benchmarks.report.standings import Standing, Standings
from benchmarks.report.statistics import Interval
from benchmarks.report.tracking_cost import Spending
from benchmarks.report.verdicts import Verdict, mean_by_trial
from benchmarks.runner.case import EXERCISE_FIGURES
from pma_gym.pages.document import TextTable

NONE = "—"
"""A cell without a figure."""

Labels = Mapping[str, str]
"""What people call the controllers, by name."""


def standings_table(standings: Standings, labels: Labels) -> TextTable:
    """Ranks and means of a measure, the best rival first, the bounds last."""
    measure = standings.errors.measure
    unit = measure.unit
    header = ["Rank", "Controller"]
    header += [f"Interquartile mean | {unit}", "Interquartile mean | 95 % interval"]
    header += [] if unit == PERCENT else ["Interquartile mean | % of range"]
    header += [f"Median ({unit})", f"Worst tenth ({unit})"]
    header += ["Over the best | ratio", "Over the best | 95 % interval"]
    bounded = standings.bound is not None
    header += ["Over the oracle | ratio", "Over the oracle | 95 % interval"] if bounded else []
    rows = [_standing_cells(row, labels, unit, bounded) for row in standings.rows]
    title = f"{capital(measure.name)}: {len(standings.errors.episodes)} cases"
    return TextTable(title, header, rows, words=2)


def ranks_table(standings: Sequence[Standings], labels: Labels) -> TextTable:
    """Interquartile mean and rank of every controller, a column a measure, for a terminal.

    Args:
        standings: the measures; controllers stand in the order of the first.
        labels: what people call the controllers.
    """
    header = ["Controller"]
    header += [
        f"{capital(each.errors.measure.name)} ({each.errors.measure.unit})" for each in standings
    ]
    columns = [{row.name: row for row in each.rows} for each in standings]
    names = dict.fromkeys(name for column in columns for name in column)
    rows = [
        [labels.get(name, name), *(_rank(column.get(name), len(names)) for column in columns)]
        for name in names
    ]
    ranked = ", rank in brackets" if len(names) > 1 else ""
    return TextTable(f"Interquartile mean{ranked}", header, rows)


def _rank(row: Standing | None, count: int) -> str:
    if row is None:
        return NONE
    mean = figure(row.mean.estimate)
    return f"{mean} [{row.rank or 'bound'}]" if count > 1 else mean


def _standing_cells(row: Standing, labels: Labels, unit: str, bounded: bool) -> list[str]:
    cells = [
        str(row.rank) if row.rank else "bound",
        labels.get(row.name, row.name),
        figure(row.mean.estimate),
        ends(row.mean),
        *([] if unit == PERCENT else [figure(row.percent)]),
        figure(row.median.estimate),
        figure(row.worst.estimate),
        *_ratio_cells(row.to_best),
    ]
    return cells + list(_ratio_cells(row.to_bound)) if bounded else cells


def pair_table(standings: Standings, labels: Labels) -> TextTable:
    """Every pair of rivals: by how much A, whose mean is smaller, is better; if they differ."""
    names = [row.name for row in standings.rows if row.rank]
    pairs = {(pair.first, pair.second): pair for pair in standings.pairs}
    cases = len(standings.errors.episodes)
    rows = []
    for first, second in combinations(names, 2):
        better, ratio = pairs[first, second], pairs[second, first].ratio
        cells = [labels.get(first, first), labels.get(second, second), figure(ratio.estimate)]
        cells += [ends(ratio), f"{better.improvement.estimate * cases:g} of {cases}"]
        rows.append([*cells, "**yes**" if better.separated else "no"])
    header = ["A", "B", "Error of B over that of A | ratio"]
    header += ["Error of B over that of A | 95 % interval", "A's is smaller (cases)", "Differ"]
    return TextTable(f"{capital(standings.errors.measure.name)}: pairs", header, rows, words=2)


def _ratio_cells(ratio: Interval | None) -> tuple[str, str]:
    if ratio is None:
        return NONE, ""
    if ratio.low == ratio.high == 1.0:
        return "1", ""
    return figure(ratio.estimate), ends(ratio)


def spending_table(rows: Sequence[Spending], title: str, unit: str, labels: Labels) -> TextTable:
    """Start and steady errors, effort, limits, computing time."""
    header = ["Controller", f"RMSE ({unit}) | first 0.5 s", f"RMSE ({unit}) | the rest"]
    header += [f"Largest error ({unit})", "Effort (V)", "Variation (V/s)", "Saturated (%)"]
    header += ["Clipped | % of steps", "Clipped | at most by (V)"]
    header += ["Beyond a soft limit | % of cases", "Beyond a soft limit | at most (%)"]
    header += ["act (us) | median", "act (us) | 99 %", "Real-time factor", "Failed"]
    cells = [
        [
            labels.get(row.name, row.name),
            *map(figure, (row.start, row.steady, row.largest)),
            *map(figure, (row.effort_v, row.variation_v_per_s)),
            _short(row.saturated_percent),
            _short(row.clipped_percent),
            figure(row.clipped_v),
            _short(row.violating_percent),
            _short(row.violation_percent),
            *map(figure, (row.act_us, row.act_us_worst, row.real_time_factor)),
            f"{row.failures} of {row.cases}",
        ]
        for row in rows
    ]
    return TextTable(title, header, cells)


def exercise_table(
    record: SuiteRecord, tasks: Sequence[str], names: Sequence[str], title: str, labels: Labels
) -> TextTable:
    """Tabulate results of exercises beside their errors: medians over cases that did not fail.

    Args:
        record: the suite's rows.
        tasks: names of the exercises.
        names: of the controllers, in the table's order.
        title: of the table.
        labels: what people call them.
    """
    rows = []
    for name in names:
        own = [row for (who, e), row in record.rows.items() if who == name and e.task in tasks]
        done = [row["exercise"] for row in own if not row["failure"]]
        medians = [float(np.median([row[f] for row in done] or [np.nan])) for f in EXERCISE_FIGURES]
        rows.append([labels.get(name, name), *map(figure, medians)])
    return TextTable(title, ["Controller", *EXERCISE_FIGURES.values()], rows)


def tasks_table(standings: Mapping[str, Standings], labels: Labels) -> TextTable:
    """Interquartile mean of every controller in every single task."""
    columns = [{row.name: row.mean for row in each.rows} for each in standings.values()]
    names = [name for name in labels if any(name in column for column in columns)]
    units = [each.errors.measure.unit for each in standings.values()]
    header = [
        "Controller",
        *(
            f"{task.replace('_', ' ')} ({unit})"
            for task, unit in zip(standings, units, strict=True)
        ),
    ]
    rows = [
        [
            labels[name],
            *(figure(column[name].estimate) if name in column else NONE for column in columns),
        ]
        for name in names
    ]
    return TextTable("Interquartile mean by task", header, rows)


def obstacle_table(
    obstacles: Mapping[tuple[str, float], str], every: Sequence[Standings]
) -> TextTable:
    """Tabulate why the actuator cannot follow, and what bound and best rival reach."""
    rows = []
    for (task, kpa), why in sorted(obstacles.items()):
        # On the way there a motor pulls; what it cannot do shows on the way back.
        *_, standings = (each for each in every if task in each.errors.measure.tasks)
        errors = standings.errors
        names = [at if at is None else errors.names[at] for at in _leaders(standings)]
        cells = [
            NONE if name is None else figure(mean_by_trial(standings, name)[task, kpa])
            for name in names
        ]
        rows.append([task, f"{kpa:g}", why, f"{errors.measure.name} ({errors.measure.unit})"])
        rows[-1] += cells
    header = ["Task", "Pressure (kPa)", "Why", "Mean error of", "Oracle", "Best rival"]
    return TextTable("Obstacles", header, rows, words=4)


def _leaders(standings: Standings) -> tuple[int | None, int | None]:
    """Numbers of the bound and of the best rival."""
    return standings.bound, standings.best


def verdict_table(checks: Sequence[Verdict]) -> TextTable:
    """Targets, what was got, met or missed."""
    rows = [
        [
            check.what,
            NONE if check.most is None else f"≤ {check.most:g} {check.unit}".strip(),
            NONE if check.got is None else f"{figure(check.got.estimate)} {check.unit}".strip(),
            "" if check.got is None else ends(check.got),
            check.word,
        ]
        for check in checks
    ]
    header = ["What", "Target", "This run", "95 % interval", "Verdict"]
    return TextTable("What the suite asks for", header, rows)


def failure_table(record: SuiteRecord, labels: Labels) -> TextTable:
    """Tabulate why cases have no figures: each reason of a controller once."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name, episode, reason in record.failures():
        groups.setdefault((name, reason), []).append(episode.name)
    rows = [
        [
            labels.get(name, name),
            cases[0] if len(cases) == 1 else f"{cases[0]} and {len(cases) - 1} more",
            reason,
        ]
        for (name, reason), cases in groups.items()
    ]
    header = ["Controller", "Case (station/task/kPa/repeat)", "Why"]
    return TextTable("Cases without figures", header, rows, words=3)


def capital(text: str) -> str:
    """The text with a capital first letter; phases keep theirs."""
    return text[:1].upper() + text[1:]


def figure(value: float) -> str:
    """Three digits, without exponent; a dash for no number."""
    if not np.isfinite(value):
        return NONE if np.isnan(value) else "∞"
    if value == 0.0:
        return "0"
    decimals = max(0, 2 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{min(decimals, 6)}f}"


def ends(interval: Interval) -> str:
    """The ends of an interval; nothing where it is not known."""
    if np.isnan(interval.low):
        return ""
    return f"[{figure(interval.low)}, {figure(interval.high)}]"


def _short(value: float) -> str:
    return NONE if np.isnan(value) else f"{value:.1f}"
