"""`python -m benchmarks identify`: the station from tables I2 and I3, judged on I3 and I1."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_or_raise
from benchmarks.files import write_text
from benchmarks.identification import station
from benchmarks.identification.statics import StationLimits, station_limits
from benchmarks.identification.station import fitted_parameters, identify, leave_out
from benchmarks.identification.transients import PressureSteps, pressure_steps
from pma_gym.cli.terminal import terminal_table
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import Model, dump_model
from pma_gym.plant.parameter_rows import Note
from pma_gym.terminal import SafeConsole

STUDENT_10 = 2.228
"""97.5 % point of Student's t with 10 degrees of freedom: 11 pressures left out in turn."""

DIGITS = 5
"""Significant digits of the values written. Correlated, they need more than their intervals bear:
with two digits of the standard errors alone the no-load contraction is off by 0.27 mm."""


def run_identify(out: Path, jobs: int = 2, console: Console | None = None) -> Model:
    """Fit the station, judge it on left-out pressures, and write it.

    Args:
        out: TOML file to write; on any processor each value is within one unit of the last digit
            that its interval bears, which is the last of those that are printed.
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
    model = _noted(whole, [fitted_parameters(fitted) for fitted, _ in folds])
    judged = [errors for _, errors in folds]
    remarks = station.unexplained(whole, data, steps)
    write_text(out, _header(station.figures(judged), remarks) + dump_model(model))
    _print(console, model, judged, remarks)
    console.print(f"written: {out}")
    return model


Fold = tuple[Model, station.LeftOut]
"""A model that was fitted without a pressure, and what it misses there."""


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
    others, here = leave_out(data, steps, pressure), data.rows(data.pressure == pressure)
    fitted = identify(*others, start)
    return fitted, station.left_out(fitted, here)


def _noted(model: Model, folds: list[dict[str, float]]) -> Model:
    """The model rounded, with intervals and sources; jackknife over the left-out pressures."""
    values, notes = {}, dict(model.notes)
    count = len(folds)
    for path, value in fitted_parameters(model).items():
        replicas = np.array([fold[path] for fold in folds])
        error = math.sqrt((count - 1) / count * np.sum((replicas - replicas.mean()) ** 2))
        low, high = _possible(model, path, value - STUDENT_10 * error, value + STUDENT_10 * error)
        values[path] = _rounded(value)
        notes[path] = Note(_source(path, low, high), _rounded(low, 3), _rounded(high, 3))
    notes["cable.damping_n_s_per_mm"] = Note("assumption: 2 % of critical")
    values["cable.damping_n_s_per_mm"] = _rounded(
        model.values_in_files("cable")["damping_n_s_per_mm"]  # type: ignore[arg-type]
    )
    return Model(model.name, model.title, model.plant, model.replace(values).parameters, notes)


def _possible(model: Model, path: str, low: float, high: float) -> tuple[float, float]:
    """The part of an interval in which a memory can lie; any other interval as it is.

    A value outside the bounds of another parameter has a meaning, such as a damping below 0 that
    tables do not tell from 0; a muscle cannot stand beyond the branch on which it was filled.
    """
    effect, _, file_key = path.partition(".")
    law = model.effects[effect]
    if law.names_in_files()[file_key] != law.memory_start:
        return low, high
    quantity = law.quantities[law.memory_start]
    return max(low, quantity.lower), min(high, quantity.upper)


def _source(path: str, low: float, high: float) -> str:
    steps = path.startswith(("symmetric_damping", "regulator_lag", "regulator_asymmetry"))
    source = "fit to Serres 2008, tables I2 and I3" if steps else "fit to Serres 2008, table I3"
    return source + ("; these tables do not tell it from 0" if low < 0.0 < high else "")


def _rounded(value: float, digits: int = DIGITS) -> float:
    return float(f"{value:.{digits}g}")


def borne_unit(standard_error: float) -> float:
    """The unit of the last digit that an interval bears: the second of its standard error.

    >>> borne_unit(13.8), borne_unit(0.00316)
    (1.0, 0.0001)
    """
    return 10.0 ** (math.floor(math.log10(standard_error)) - 1)


def borne(value: float, unit: float) -> str:
    """A value with its last digit in a unit.

    >>> borne(16.762, 1.0), borne(0.052617, 0.0001), borne(604.0, 10.0)
    ('17', '0.0526', '600')
    """
    return f"{round(value / unit) * unit:.{max(0, round(-math.log10(unit)))}f}"


def _header(figures: dict[str, float], remarks: list[str]) -> str:
    lines = [
        "Written by `python -m benchmarks identify`. Intervals: 95 %, jackknife over pressures.",
        f"Left-out pressures: extension {figures['extension_mm']:.2f} mm RMSE, rotation "
        f"{figures['rotation_deg']:.2f} deg RMSE, no-load contraction within "
        f"{figures['no_load_mm']:.2f} mm.",
        "Not explained:",
        *(f"- {line}" for line in remarks),
    ]
    return "".join(f"# {line}\n" for line in lines)


def _print(
    console: Console, model: Model, folds: list[station.LeftOut], remarks: list[str]
) -> None:
    rows = []
    for path, note in model.notes.items():
        if note.low is not None:
            effect, _, file_key = path.partition(".")
            value = model.values_in_files(effect)[file_key]
            assert isinstance(value, float) and note.high is not None
            unit = borne_unit(0.5 * (note.high - note.low) / STUDENT_10)
            rows.append([path, *(borne(each, unit) for each in (value, note.low, note.high))])
    parameters = TextTable("Identified station", ("parameter", "value", "low", "high"), rows)
    header = ("left-out pressure (kPa)", "extension RMSE (mm)", "rotation RMSE (deg)")
    left_out = TextTable(
        "Predicted less measured, table I3",
        (*header, "no-load contraction (mm)"),
        [
            [
                f"{fold.pressure / 1e3:.0f}",
                f"{station.rms(fold.extension):.2f}",
                f"{station.rms(fold.rotation):.2f}",
                f"{fold.no_load:+.2f}",
            ]
            for fold in folds
        ],
    )
    console.print(terminal_table(parameters), terminal_table(left_out))
    for name, figure in station.figures(folds).items():
        target = station.TARGETS[name]
        verdict = "met" if figure <= target else "MISSED"
        console.print(f"{name}: {figure:.2f}, target {target:g}: {verdict}")
    console.print("Not explained:")
    for line in remarks:
        console.print(f"- {line}")
