"""The proposed experiment as the lab's own command file: its columns, its units, from rest."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import Dataset
from pma_gym.data.files.trial_formats import encode_csv
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import (
    BY_QUANTITY,
    VOLTAGE_RANGE,
    Source,
)
from pma_gym.discovery.preparation.data_checks.proposals import file_sources
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

REST_S = 1.0
"""Time at rest before the way to the first commands, and settled under them after it (s)."""

FULL_RANGE_S = 10.0
"""Time of a way over the whole range of the motor's command (s): slow enough for any rig."""

LEAST_WAY_S = 1.0
"""Shortest way to the first commands (s)."""

DIGITS = 9
"""Significant digits that are written: far finer than any DAQ."""


def proposed_file(trial: Trial, dataset: Dataset, model: Model) -> bytes:
    """A CSV file of a proposed experiment, as the lab's own files have their commands.

    Args:
        trial: the experiment, in volts; it begins settled at its first commands.
        dataset: whose columns and commands to write.
        model: what the data set was compared with: its lines make pressures and loads of volts.
    Returns:
        Times from 0 and commands under the lab's names, in its units, factor and offset undone. The
        first rows stand at no load under the first pressure, then lead to the first commands.
    """
    led = from_rest(trial, model)
    commands = _as_commanded(led, dataset, model)
    names = _names(dataset)
    columns = {}
    for quantity, values in {"time": led.time - led.time[0], **commands}.items():
        column = BY_QUANTITY[quantity]
        source = names.get(quantity, Source(0, column.name, column))
        theirs = (values / SI_FACTORS[column.unit] - source.offset) / source.factor
        columns[source.name] = np.array([float(f"{v:.{DIGITS}g}") for v in theirs.tolist()])
    return encode_csv(columns, {})


def from_rest(trial: Trial, model: Model) -> Trial:
    """An experiment with the way from no load to its first commands before it.

    The same experiment where it begins without load, or where the model cannot rest without load,
    as a free rig never does.
    """
    motor = trial.commands.get("motor_voltage")
    if model.rig.is_free or motor is None or float(motor[0]) == 0.0:
        return trial
    first = float(motor[0])
    way = max(LEAST_WAY_S, FULL_RANGE_S * first / VOLTAGE_RANGE[1])
    step = float(np.median(np.diff(trial.time)))
    times = np.arange(-round((2.0 * REST_S + way) / step), 0) * step
    knots = [-(2.0 * REST_S + way), -(REST_S + way), -REST_S, 0.0]
    led_in = {"motor_voltage": np.interp(times, knots, [0.0, 0.0, first, first])}
    led = Trial(
        np.concatenate([trial.time[0] + times, trial.time]),
        {
            name: np.concatenate([led_in.get(name, np.full(times.size, values[0])), values])
            for name, values in trial.commands.items()
        },
        provenance=trial.provenance,
    )
    try:
        simulated = Plant(model).simulate(led, noise=False)
    # No rest without load: then the lab has to find its own way to the first commands.
    except ValueError:
        return trial
    return led if np.isfinite(simulated.truth["load"]).all() else trial


def _as_commanded(trial: Trial, dataset: Dataset, model: Model) -> Mapping[str, Array]:
    """Commands (SI) of the kinds that the lab commands."""
    asked = {name for each in dataset.trials for name in each.trial.commands}
    commands = dict(trial.commands)
    lines = {
        "motor_voltage": ("load_command", model.parameters.get("drive")),
        "regulator_voltage": ("pressure_command", model.parameters.get("regulator_line")),
    }
    for voltage, (wish, line) in lines.items():
        if voltage in commands and voltage not in asked and wish in asked and line is not None:
            commands[wish] = line.gain * commands.pop(voltage) + line.offset
    return commands


def _names(dataset: Dataset) -> dict[str, Source]:
    """By quantity, how the lab's files call and scale it; the first file that has it counts."""
    columns: dict[str, Source] = {}
    for each in dataset.trials if dataset.folder is not None else ():
        for source in file_sources(dataset, each.name):
            columns.setdefault(source.column.quantity, source)
    return columns
