"""The leaderboard's tables as text.

Costs of tracking: start and steady errors, effort, limits, computing time.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from benchmarks.report.errors import PERCENT, Measure, SuiteRecord
from benchmarks.report.standings import Standing, Standings
from benchmarks.report.statistics import Interval
from benchmarks.report.verdicts import Verdict, mean_by_trial
from benchmarks.runner.case import EXERCISE_FIGURES
from pma_gym.pages.document import TextTable

MICROSECONDS = 1e6
"""Microseconds in a second."""


def spending(record: SuiteRecord, measure: Measure, names: Sequence[str]) -> list[dict[str, Any]]:
    """Return the costs of each controller in a measure's tasks.

    Returns:
        Medians over the cases that a controller did not fail in, all NaN if it failed in all:
            name: of the controller.
            cases: how many cases it has.
            failures: how many of them failed.
            start: RMSE of the first 0.5 s (the task's unit).
            steady: RMSE of the rest.
            largest: largest error of all phases.
            effort_v: standard deviation of the voltage (V).
            variation_v_per_s: total variation of the voltage (V/s).
            saturated_percent: mean share of the control steps at 0 or 10 V (%).
            clipped_percent: mean share of the control steps whose command, below 0 V or above 10 V,
                was clipped (%).
            clipped_v: how far beyond 0-10 V a command of any case was (V).
            violating_percent: share of the cases that passed a soft limit (%).
            violation_percent: the largest violation of any case (% of the way to the hard limit).
            act_us: computing time of `act` (us).
            act_us_worst: its 99th percentile (us).
            real_time_factor: how often `act` fits into a control period, at that percentile.
    """
    return [_of_one(record, measure, name) for name in names]


def _of_one(record: SuiteRecord, measure: Measure, name: str) -> dict[str, Any]:
    rows = [
        row
        for (who, episode), row in record.rows.items()
        if who == name and episode.task in measure.tasks
    ]
    done = [row for row in rows if not row["failure"]]

    def column(field: str) -> np.ndarray:
        return np.array([row.get(field, np.nan) for row in done] or [np.nan], dtype=np.float64)

    largest = [max(phase["largest_error"] for phase in row["phases"].values()) for row in done]
    worst_us = float(np.median(column("act_us_worst")))
    period_us = MICROSECONDS / record.suite.control_rate_hz
    return dict(
        name=name,
        cases=len(rows),
        failures=len(rows) - len(done),
        start=float(np.median(column("start_rmse"))),
        steady=float(np.median(column("steady_rmse"))),
        largest=float(np.median(largest)) if largest else np.nan,
        effort_v=float(np.median(column("effort_v"))),
        variation_v_per_s=float(np.median(column("variation_v_per_s"))),
        saturated_percent=100.0 * float(np.mean(column("saturation_share"))),
        clipped_percent=100.0 * float(np.mean(column("clipped_share"))),
        clipped_v=float(np.max(column("clipped_v"))),
        violating_percent=100.0 * float(np.mean(column("violation") > 0.0)) if done else np.nan,
        violation_percent=100.0 * float(np.max(column("violation"))),
        act_us=float(np.median(column("act_us"))),
        act_us_worst=worst_us,
        real_time_factor=period_us / worst_us,
    )


NONE = "—"
"""A cell without a figure."""

Labels = Mapping[str, str]
"""What people call the controllers, by name."""


def standings_table(standings: Standings, labels: Labels) -> TextTable:
    """Ranks and means of a measure, the best rival first, the bounds last."""
    measure = standings.errors.measure
    unit = measure.unit
    header = [
        "Rank",
        "Controller",
        f"Interquartile mean | {unit}",
        "Interquartile mean | 95 % interval",
        *([] if unit == PERCENT else ["Interquartile mean | % of range"]),
        f"Median ({unit})",
        f"Worst tenth ({unit})",
        "Over the best | ratio",
        "Over the best | 95 % interval",
    ]
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
    header = [
        "Controller",
        *(
            f"{capital(each.errors.measure.name)} ({each.errors.measure.unit})"
            for each in standings
        ),
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
        cells = [
            labels.get(first, first),
            labels.get(second, second),
            figure(ratio.estimate),
            ends(ratio),
            f"{better.improvement.estimate * cases:g} of {cases}",
        ]
        rows.append([*cells, "**yes**" if better.separated else "no"])
    return TextTable(
        f"{capital(standings.errors.measure.name)}: pairs",
        [
            "A",
            "B",
            "Error of B over that of A | ratio",
            "Error of B over that of A | 95 % interval",
            "A's is smaller (cases)",
            "Differ",
        ],
        rows,
        words=2,
    )


def _ratio_cells(ratio: Interval | None) -> tuple[str, str]:
    if ratio is None:
        return NONE, ""
    if ratio.low == ratio.high == 1.0:
        return "1", ""
    return figure(ratio.estimate), ends(ratio)


def spending_table(
    rows: Sequence[Mapping[str, Any]], title: str, unit: str, labels: Labels
) -> TextTable:
    """Start and steady errors, effort, limits, computing time."""
    header = [
        "Controller",
        f"RMSE ({unit}) | first 0.5 s",
        f"RMSE ({unit}) | the rest",
        f"Largest error ({unit})",
        "Effort (V)",
        "Variation (V/s)",
        "Saturated (%)",
        "Clipped | % of steps",
        "Clipped | at most by (V)",
        "Beyond a soft limit | % of cases",
        "Beyond a soft limit | at most (%)",
        "act (us) | median",
        "act (us) | 99 %",
        "Real-time factor",
        "Failed",
    ]
    cells = [
        [
            labels.get(row["name"], row["name"]),
            *map(figure, (row["start"], row["steady"], row["largest"])),
            *map(figure, (row["effort_v"], row["variation_v_per_s"])),
            _short(row["saturated_percent"]),
            _short(row["clipped_percent"]),
            figure(row["clipped_v"]),
            _short(row["violating_percent"]),
            _short(row["violation_percent"]),
            *map(figure, (row["act_us"], row["act_us_worst"], row["real_time_factor"])),
            f"{row['failures']} of {row['cases']}",
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
        leaders = (standings.bound, standings.best)
        names = [at if at is None else errors.names[at] for at in leaders]
        cells = [
            NONE if name is None else figure(mean_by_trial(standings, name)[task, kpa])
            for name in names
        ]
        rows.append([task, f"{kpa:g}", why, f"{errors.measure.name} ({errors.measure.unit})"])
        rows[-1] += cells
    return TextTable(
        "Obstacles",
        ["Task", "Pressure (kPa)", "Why", "Mean error of", "Oracle", "Best rival"],
        rows,
        words=4,
    )


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
    return TextTable(
        "What the suite asks for", ["What", "Target", "This run", "95 % interval", "Verdict"], rows
    )


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
    return TextTable(
        "Cases without figures",
        ["Controller", "Case (station/task/kPa/repeat)", "Why"],
        rows,
        words=3,
    )


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
