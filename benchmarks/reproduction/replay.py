"""Measured against simulated: the dissertation's own commands, on the simulated station."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from benchmarks.reproduction.results import Results
from benchmarks.runner.phase_score import PHASES, measured_score
from pma_gym.data.serres2008 import load_table

QUANTITIES = ("slope", "intercept", "mean", "rmse", "line_error", "scatter")
"""What is compared, attributes of a `PhaseScore`; mean is the line's position mid-phase."""


@dataclass(frozen=True)
class ReplayError:
    """One phase of one trial, simulated less measured, in the task's unit.

    Attributes:
        task: `displacement` or `rotation`.
        phase: of it.
        pressure_kpa: of the trial (kPa).
        slope: error of the slope (unit/s).
        intercept: error of the intercept (unit).
        mean: error of the mean position (unit).
        rmse: difference of the RMSE against the ideal (unit).
        line_error: difference of its part in the regression line (unit).
        scatter: difference of its part about the line (unit).
    """

    task: str
    phase: str
    pressure_kpa: float
    slope: float
    intercept: float
    mean: float
    rmse: float
    line_error: float
    scatter: float


@dataclass(frozen=True)
class ReplaySummary:
    """Means over the trials of a phase, by quantity.

    Attributes:
        signed: mean errors; what they have in common.
        absolute: mean absolute errors.
        trials: how many.
    """

    signed: dict[str, float]
    absolute: dict[str, float]
    trials: int


def replay_errors(results: Results, model: str, task: str, phase: str) -> list[ReplayError]:
    """Errors of the replay on a model, trial by trial; failed cases are left out."""
    errors = []
    for pressure in results.suite.pressures_kpa.get(task, ()):
        simulated = results.phase(model, results.suite.goals.replay, task, pressure, phase)
        if simulated is not None:
            measured = measured_score(task, phase, pressure)
            off = (getattr(simulated, name) - getattr(measured, name) for name in QUANTITIES)
            errors.append(ReplayError(task, phase, pressure, *off))
    return errors


def all_replay_errors(results: Results, model: str) -> dict[tuple[str, str], list[ReplayError]]:
    """Errors of the replay by task and phase, for the phases that were run."""
    by_phase = {
        (task, phase): replay_errors(results, model, task, phase)
        for task, phases in PHASES.items()
        for phase in phases
    }
    return {key: errors for key, errors in by_phase.items() if errors}


def summarise(errors: Sequence[ReplayError]) -> ReplaySummary:
    """Mean and mean absolute errors."""
    values = {name: np.array([getattr(error, name) for error in errors]) for name in QUANTITIES}
    return ReplaySummary(
        signed={name: float(np.mean(array)) for name, array in values.items()},
        absolute={name: float(np.mean(np.abs(array))) for name, array in values.items()},
        trials=len(errors),
    )


class TableAngle(NamedTuple):
    """Angle of a rotation trial's hold by table I3.

    Attributes:
        angle: mean angle (deg).
        extrapolated: whether the voltages lie, on the mean, above the table's highest.
    """

    angle: float
    extrapolated: bool


def table_angle(pressure_kpa: float) -> TableAngle:
    """Angle that table I3 gives for the voltages of a rotation trial's hold.

    The mean, over the samples held from 5 s to 10 s, of I3's rotation (mean of its three
    repeats), joined linearly between its voltages and from 0, and drawn on beyond the highest,
    8.45 V. Nothing is simulated: this is what the same station did at these voltages in the
    dissertation's other experiment.

    Args:
        pressure_kpa: a pressure of the rotation task (kPa).
    """
    table = load_table("I3").where(pressure_nominal_kpa=pressure_kpa)
    volts = np.unique(table["motor_voltage_v"])
    angles = np.array([np.mean(table.where(motor_voltage_v=v)["rotation_deg"]) for v in volts])
    volts_at_rest = _rotation_profile(pressure_kpa)
    inside = np.interp(volts_at_rest, [0.0, *volts], [0.0, *angles])
    last_slope = (angles[-1] - angles[-2]) / (volts[-1] - volts[-2])
    beyond = last_slope * np.maximum(volts_at_rest - volts[-1], 0.0)
    return TableAngle(float(np.mean(inside + beyond)), bool(np.mean(volts_at_rest) > volts[-1]))


def _rotation_profile(pressure_kpa: float) -> np.ndarray:
    """Printed voltages (V) of a rotation trial from 5 s to 10 s."""
    for number in range(13, 21):
        table = load_table(f"I{number}")
        if float(table["pressure_kpa"][0]) == pressure_kpa:
            return table["motor_voltage_v"][(table["time_s"] >= 5.0) & (table["time_s"] < 10.0)]
    raise KeyError(f"no rotation trial at {pressure_kpa:g} kPa")
