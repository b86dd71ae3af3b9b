"""Tables in the layout of the dissertation's 21, 22 and 27-30, its columns beside ours."""

from collections.abc import Callable, Iterable, Sequence
from statistics import fmean

from benchmarks.reproduction.replay import QUANTITIES, ReplayError, summarise
from benchmarks.reproduction.results import Results
from benchmarks.runner.phase_score import PHASES, UNITS, PhaseScore, measured_score
from benchmarks.suites.reproduction import MEASURED
from pma_gym.pages.document import TextTable

RULE = [""]
MISSING = "failed"

REGRESSION_TABLES = {"displacement": "21", "I": "27", "II": "28", "III": "29"}
"""Printed tables of slope and intercept, by phase."""

REPLAY_NAMES = ("intercept", "mean position", "RMSE", "line part", "scatter")
"""Quantities of a replay's errors after the slope, for people."""

Figures = Callable[[float], PhaseScore | None]


def columns(results: Results, model: str, task: str, phase: str) -> dict[str, Figures]:
    """Return the columns of a table, measured first: figures by pressure."""
    by_title: dict[str, Figures] = {MEASURED: lambda p: measured_score(task, phase, p)}
    for controller in results.suite.controllers:
        if not results.suite.does(controller, model):
            continue
        name = controller.name
        by_title[controller.label] = lambda p, name=name: results.phase(model, name, task, p, phase)
    return by_title


def summary_table(results: Results) -> TextTable:
    """RMSE over the pressures of each phase on the first model, mean and largest, for everybody."""
    main = results.suite.models[0]
    header, rows = ["Controller"], dict[str, list[str]]()
    for task, pressures in results.suite.pressures_kpa.items():
        for phase in PHASES[task]:
            name = "Displacement" if task == phase else f"Rotation {phase}"
            header.append(f"{name} ({UNITS[task]})")
            for who, figures in columns(results, main, task, phase).items():
                known = [score.rmse for p in pressures if (score := figures(p))]
                failed = len(known) < len(pressures)
                cell = MISSING if failed else f"{fmean(known):.3g} ({max(known):.3g})"
                rows.setdefault(who, []).append(cell)
    return TextTable(
        f"RMSE on {main}: mean (largest) over the pressures",
        header,
        [[who, *cells] for who, cells in rows.items()],
    )


def rmse_table(results: Results, model: str, task: str, phase: str) -> TextTable:
    """Table 22, or a third of table 30: RMSE and percent of the range, by pressure."""
    unit = UNITS[task]
    who = columns(results, model, task, phase)
    pressures = results.suite.pressures_kpa[task]
    bounded = phase == "III" and model == results.suite.models[0] and bool(results.bounds)
    header = ["Pressure (kPa)", *(f"{name} | {part}" for name in who for part in (unit, "%"))]
    rows = [
        [f"{p:g}", *(text for figures in who.values() for text in _rmse_cells(figures(p)))]
        for p in pressures
    ]
    mean = ["mean"]
    for figures in who.values():
        scores = [figures(p) for p in pressures]
        mean += [_mean(s.rmse if s else None for s in scores)]
        mean += [_mean((s.percent_of_range if s else None for s in scores), 2)]
    if bounded:
        header.append(f"Achievable bound | {unit}")
        bounds = [results.bounds.get(p) for p in pressures]
        rows = [[*row, _number(b, 3)] for row, b in zip(rows, bounds, strict=True)]
        mean.append(_mean(bounds))
    number, part = ("22", "") if task == "displacement" else ("30", f", phase {phase}")
    return TextTable(
        f"Table {number}{part}: RMSE against the ideal, and in percent of the range",
        header,
        [*rows, RULE, mean],
    )


def regression_table(results: Results, model: str, task: str, phase: str) -> TextTable:
    """Table 21 or 27-29: intercept and slope with their standard errors, by pressure."""
    unit = UNITS[task]
    who = columns(results, model, task, phase)
    rows: list[list[str]] = []
    for pressure in results.suite.pressures_kpa[task]:
        scores = [figures(pressure) for figures in who.values()]
        rows.append(
            [f"{pressure:g}", f"intercept ({unit})", *(_term(each, "intercept") for each in scores)]
        )
        rows.append(["", f"slope ({unit}/s)", *(_term(each, "slope") for each in scores)])
    part = "" if task == "displacement" else f", phase {phase}"
    return TextTable(
        f"Table {REGRESSION_TABLES[phase]}{part}: line through the trial (standard error)",
        ["Pressure (kPa)", "Term", *who],
        rows,
        words=2,
    )


def replay_table(errors: Sequence[ReplayError]) -> TextTable:
    """Signed errors of the replay in one phase, trial by trial, and their means."""
    unit = UNITS[errors[0].task]
    means = summarise(errors)
    header = ["Pressure (kPa)", f"slope ({unit}/s)", *(f"{name} ({unit})" for name in REPLAY_NAMES)]
    rows = [
        [f"{error.pressure_kpa:g}", *(f"{getattr(error, name):+.3f}" for name in QUANTITIES)]
        for error in errors
    ]
    signed = ["mean", *(f"{means.signed[name]:+.3f}" for name in QUANTITIES)]
    absolute = ["mean absolute", *(f"{means.absolute[name]:.3f}" for name in QUANTITIES)]
    phase = errors[0].phase
    part = "Displacement" if phase == "displacement" else f"Rotation, phase {phase}"
    return TextTable(f"{part}: simulated less measured", header, [*rows, RULE, signed, absolute])


def _rmse_cells(score: PhaseScore | None) -> tuple[str, str]:
    if score is None:
        return MISSING, ""
    return _number(score.rmse, 3), _number(score.percent_of_range, 2)


def _term(score: PhaseScore | None, name: str) -> str:
    if score is None:
        return MISSING
    return _with_error(getattr(score, name), getattr(score, f"{name}_std_error"))


def _with_error(estimate: float, error: float) -> str:
    return f"{estimate:z.3f} ({error:.3f})"


def _mean(values: Iterable[float | None], decimals: int = 3) -> str:
    """The mean; nothing if one of the values is missing."""
    known = list(values)
    numbers = [value for value in known if value is not None]
    return _number(fmean(numbers) if len(numbers) == len(known) else None, decimals)


def _number(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"
