"""The bounds of an exercise as tables, for the terminal, the report and Markdown."""

import math
from collections.abc import Iterable, Sequence

from benchmarks.exercise.lag.bounds import Foreknown, LagBounds, medians
from benchmarks.exercise.lag.causal import Causal
from benchmarks.exercise.lag.points import Point
from benchmarks.exercise.lag.swing import FREQUENCIES_HZ, Swing
from pma_gym.pages.document import TextTable, to_markdown
from pma_gym.tasks import EVERY_TASK


def bound_tables(bounds: LagBounds) -> list[str]:
    """All tables as Markdown."""
    tables = causal_table(bounds.causal), swing_table(bounds.swings)
    listed = (foreknown_table(bounds.foreknown), *tables) if bounds.foreknown else tables
    return [to_markdown([table], {}, "") for table in listed]


def foreknown_table(rows: Sequence[Foreknown]) -> TextTable:
    """Medians over the operators, a line for each pressure, lag and safety layer."""
    unit = _unit(rows[0].task)
    header = ["Exercise", "Pressure (kPa)", "Regulator's lag (s)", "Safety layer", "Operators"]
    header += [f"{name} ({unit})" for name in rows[0].by_phase]
    header += ["Worst phase of all", f"I, his own ({unit})", "At 0 or 10 V (%)"]
    lines = [_foreknown_line(group) for group in _groups(rows)]
    title = "Achieved by who knows the operator's course: RMSE by phase, medians over operators"
    return TextTable(title, header, lines, words=2)


def _groups(rows: Iterable[Foreknown]) -> list[list[Foreknown]]:
    """Rows of one pressure, lag and safety layer, in order."""
    groups: dict[tuple[object, ...], list[Foreknown]] = {}
    for row in rows:
        key = row.task, str(row.pressure_kpa), row.lag, row.safety
        groups.setdefault(key, []).append(row)
    return list(groups.values())


def _foreknown_line(group: Sequence[Foreknown]) -> list[str]:
    first, middle = group[0], len(group) // 2
    floors = sorted(row.floor for row in group)
    floor = 0.5 * (floors[middle] + floors[-middle - 1])
    pressure, digits = first.pressure_kpa, 3 if floor else 4
    return [
        first.task,
        pressure if isinstance(pressure, str) else f"{pressure:g}",
        f"{first.lag:.3g}",
        "on" if first.safety else "off",
        f"{len(group)}",
        *(f"{error:.{digits}f}" for error in medians(group).values()),
        f"{max(max(row.by_phase.values()) for row in group):.{digits}f}",
        f"{floor:.3f}" if floor else "—",
        f"{100.0 * sum(row.saturated for row in group) / len(group):.1f}",
    ]


def causal_table(rows: Sequence[Causal]) -> TextTable:
    """Standard deviations near every point: at a constant voltage, and the least by lag."""
    unit, lags = _unit(rows[0].point.task), sorted({row.lag for row in rows})
    header = ["Exercise", "Point", "Room (V)", f"Constant voltage ({unit})"]
    header += [f"All known | {lag:.3g} s" for lag in lags]
    header += [f"By the sensors | {lag:.3g} s" for lag in lags]
    lines = [_causal_line(point, rows, lags) for point in dict.fromkeys(r.point for r in rows)]
    late = max(row.delay for row in rows)
    title = f"Least causal standard deviation ({unit}) by the regulator's lag, {late} step late"
    return TextTable(title, header, lines, words=2)


def _causal_line(point: Point, rows: Sequence[Causal], lags: Sequence[float]) -> list[str]:
    own = [row for row in rows if row.point == point]
    late = max(row.delay for row in own)
    least = {(row.sensed, row.lag): row.least for row in own if row.delay == late}
    digits = {False: 5, True: 4}
    cells = [f"{least[s, lag]:.{digits[s]}f}" for s in (False, True) for lag in lags]
    return [point.task, _place(point), f"{point.room:.2f}", f"{own[0].uncontrolled:.3f}", *cells]


def swing_table(rows: Sequence[Swing]) -> TextTable:
    """Largest moments that a swing of 0-10 V cancels, by frequency."""
    header = ["Exercise", "Point", "Moment (N m)"]
    header += [f"{frequency:g} Hz" for frequency in FREQUENCIES_HZ]
    header += ["Any voltage | 0 Hz", "1 N m up to (Hz)"]
    lines = [
        [
            swing.point.task,
            _place(swing.point),
            f"{swing.point.moment:.1f}",
            *(f"{swing.moment(frequency):.2f}" for frequency in FREQUENCIES_HZ),
            f"{swing.most(0.0):.2f}",
            f"{swing.highest_frequency(1.0):.0f}",
        ]
        for swing in rows
    ]
    title = f"Largest moment (N m) cancelled by a sine of voltage behind {rows[0].lag:.3g} s"
    return TextTable(title, header, lines, words=2)


def _place(point: Point) -> str:
    return f"{math.degrees(point.angle):.0f} deg, {1e-3 * point.pressure:.0f} kPa"


def _unit(task: str) -> str:
    return EVERY_TASK[task].schedule.unit
