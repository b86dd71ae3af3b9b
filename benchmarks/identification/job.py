"""`python -m benchmarks identify`: the station from tables I2 and I3, judged on I3 and I1."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_or_raise
from benchmarks.files import write_text
from benchmarks.identification import judge
from benchmarks.identification.measurements import StationLimits, station_limits
from benchmarks.identification.station import fitted_parameters, identify, leave_out
from benchmarks.identification.transients import PressureSteps, pressure_steps
from pma_gym.plant.model import Model, Note, dump_model
from pma_gym.terminal import SafeConsole

STUDENT_10 = 2.228
"""97.5 % point of Student's t with 10 degrees of freedom: 11 pressures left out in turn."""

DIGITS = 5
"""Significant digits of the values written: below every interval, above what machines differ by."""


def run_identify(out: Path, jobs: int = 2, console: Console | None = None) -> Model:
    """Fit the station, judge it on left-out pressures, and write it.

    Args:
        out: TOML file to write; re-running writes the same bytes.
        jobs: processes.
        console: where to print.
    Returns:
        The model as written.
    Raises:
        KeyboardInterrupt: Ctrl-C, before anything is written.
    """
    console = console or SafeConsole()
    data, steps = station_limits(), pressure_steps()
    whole = identify(data, steps)
    start = fitted_parameters(whole)
    works = [partial(_fold, data, steps, float(pressure), start) for pressure in data.pressures]
    folds = _all_folds(works, jobs, console)
    model = _noted(whole, [fitted_parameters(fold) for fold, _ in folds])
    judged = [errors for _, errors in folds]
    words = judge.unexplained(whole, data, steps)
    write_text(out, _header(judge.figures(judged), words) + dump_model(model))
    _print(console, model, judged, words)
    console.print(f"written: {out}")
    return model


Fold = tuple[Model, judge.LeftOut]


def _all_folds(works: Sequence[partial[Fold]], jobs: int, console: Console) -> list[Fold]:
    """The fits with one pressure left out, in order."""
    folds: dict[int, Fold] = {}
    with Progress(console=console) as progress:
        bar = progress.add_task("pressures left out", total=len(works))

        def keep(index: int, fold: Fold) -> None:
            folds[index] = fold
            progress.update(bar, advance=1)

        run_or_raise(works, local(jobs), keep)
    return [folds[index] for index in range(len(works))]


def _fold(
    data: StationLimits, steps: PressureSteps, pressure: float, start: dict[str, float]
) -> Fold:
    """The station fitted without a pressure (Pa), and how it predicts that one."""
    model = identify(*leave_out(data, steps, pressure), start)
    return model, judge.left_out(model, data.rows(data.pressure == pressure))


def _noted(model: Model, folds: list[dict[str, float]]) -> Model:
    """The model rounded, with intervals and sources; jackknife over the left-out pressures."""
    values, notes = {}, dict(model.notes)
    count = len(folds)
    for path, value in fitted_parameters(model).items():
        replicas = np.array([fold[path] for fold in folds])
        error = math.sqrt((count - 1) / count * np.sum((replicas - replicas.mean()) ** 2))
        low, high = value - STUDENT_10 * error, value + STUDENT_10 * error
        values[path] = _rounded(value)
        notes[path] = Note(_source(path, low, high), _rounded(low, 3), _rounded(high, 3))
    notes["cable.damping_n_s_per_mm"] = Note("assumption: 2 % of critical")
    values["cable.damping_n_s_per_mm"] = _rounded(
        model.at_the_door("cable")["damping_n_s_per_mm"]  # type: ignore[arg-type]
    )
    rounded = model.replace(values)
    return Model(model.name, model.title, model.plant, rounded.parameters, notes)


def _source(path: str, low: float, high: float) -> str:
    steps = path.startswith(("symmetric_damping", "regulator_lag", "regulator_asymmetry"))
    source = "fit to Serres 2008, tables I2 and I3" if steps else "fit to Serres 2008, table I3"
    return source + ("; these tables do not tell it from 0" if low < 0.0 < high else "")


def _rounded(value: float, digits: int = DIGITS) -> float:
    return float(f"{value:.{digits}g}")


def _header(figures: dict[str, float], words: list[str]) -> str:
    lines = [
        "Written by `python -m benchmarks identify`. Intervals: 95 %, jackknife over pressures.",
        f"Left-out pressures: extension {figures['extension_mm']:.2f} mm RMSE, rotation "
        f"{figures['rotation_deg']:.2f} deg RMSE, no-load contraction within "
        f"{figures['no_load_mm']:.2f} mm.",
        "Not explained:",
        *(f"- {line}" for line in words),
    ]
    return "".join(f"# {line}\n" for line in lines)


def _print(console: Console, model: Model, folds: list[judge.LeftOut], words: list[str]) -> None:
    table = Table("parameter", "value", "low", "high", title="Identified station")
    for path, note in model.notes.items():
        if note.low is not None:
            effect, _, door = path.partition(".")
            value = model.at_the_door(effect)[door]
            table.add_row(path, f"{value:.5g}", f"{note.low:.3g}", f"{note.high:.3g}")
    console.print(table)
    table = Table(
        "left-out pressure (kPa)",
        "extension RMSE (mm)",
        "rotation RMSE (deg)",
        "no-load contraction (mm)",
        title="Predicted less measured, table I3",
    )
    for fold in folds:
        table.add_row(
            f"{fold.pressure / 1e3:.0f}",
            f"{judge.rms(fold.extension):.2f}",
            f"{judge.rms(fold.rotation):.2f}",
            f"{fold.no_load:+.2f}",
        )
    console.print(table)
    for name, figure in judge.figures(folds).items():
        target = judge.TARGETS[name]
        verdict = "met" if figure <= target else "MISSED"
        console.print(f"{name}: {figure:.2f}, target {target:g}: {verdict}")
    console.print("Not explained:")
    for line in words:
        console.print(f"- {line}")
