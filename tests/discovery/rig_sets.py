"""Small data sets of other rigs, as a lab would have them: `python -m tests.discovery.rig_sets`.

It writes the trials in `rigs/`, always the same: the logs of `rig_trials`, at their sensors' steps,
with as many digits as a lab writes. What people wrote, models and `dataset.toml`, stands there.
"""

import csv
from pathlib import Path

import numpy as np

from pma_gym.data.calibration import LVDT, PRESSURE_TRANSDUCER
from pma_gym.data.trial_columns import BY_QUANTITY
from tests.discovery.rig_trials import (
    FROZEN,
    at,
    driven_slide,
    hanging_load,
    logged,
    one_long_trial,
)

DIGITS = {"time_s": 4, "motor_voltage_v": 4, "regulator_voltage_v": 4}
"""Digits behind the point; three in other columns."""


def columns(trial):
    """A log's columns by our names, rounded."""
    held = {"time": trial.time, **trial.commands, **trial.measurements}
    named = {BY_QUANTITY[quantity]: values for quantity, values in held.items()}
    return {
        column.name: np.round(column.from_si(values), DIGITS.get(column.name, 3))
        for column, values in named.items()
    }


def some(log, *names):
    """Of the measured columns of a log some alone."""
    commands = ("time_s", "motor_voltage_v", "regulator_voltage_v")
    return {name: values for name, values in log.items() if name in (*commands, *names)}


def jittered(rate, lane, seconds):
    """Times (s) of a log that jitter by a fifth of a row, one row in twelve dropped."""
    generator = np.random.default_rng(lane)
    times = at(rate, seconds)
    times[1:-1] += generator.uniform(-0.2, 0.2, times.size - 2) / rate
    kept = generator.random(times.size) > 1 / 12
    kept[[0, -1]] = True
    return np.round(times[kept], 4)


def uneven():
    """The station: times that jitter, rows that are missing, other channels in every trial."""
    channels = {
        0: ("contraction_mm",),
        1: ("contraction_mm", "pressure_kpa"),
        2: ("rotation_deg", "load_n"),
        4: ("rotation_deg", "pressure_kpa"),
    }
    logs = {lane: columns(logged(lane, jittered(200, lane, 2.5))) for lane in channels}
    return {
        f"run_{k + 1}.csv": some(logs[lane], *names)
        for k, (lane, names) in enumerate(channels.items())
    }


SHORT_V = 3.2
"""Where the LVDT of the raw volts ends: it is too short for its rig."""


def raw_volts():
    """The station: milliseconds, volts and bar, no load cell, an LVDT that ends too early."""
    files = {}
    for lane in range(3):
        trial = logged(lane, at(50, 3.5))
        read = trial.measurements
        files[f"run_{lane + 1}.csv"] = {
            "ms": 1e3 * trial.time,
            "U_Motor": np.round(trial.commands["motor_voltage"], 4),
            "U_Regler": np.round(trial.commands["regulator_voltage"], 4),
            "U_Weg": np.round(np.minimum(LVDT.to_volts(read["contraction"]), SHORT_V), 4),
            "U_Druck": np.round(PRESSURE_TRANSDUCER.to_volts(read["pressure"]), 4),
        }
    return files


def two_rates():
    """The station: a fast log and slow ones of the same drive, which is late."""
    hidden, names = "drive_delay", ("rotation_deg", "load_n")
    logs = {
        "fast_2000hz.csv": logged(1, at(2000, 1.2), hidden),
        "slow_50hz_1.csv": logged(2, at(50, 4.0), hidden),
        "slow_50hz_2.csv": logged(4, at(50, 4.0), hidden),
    }
    return {file: some(columns(log), *names) for file, log in logs.items()}


def numbered(trials):
    """Logs by the name of their file."""
    return {f"run_{k + 1}.csv": columns(trial) for k, trial in enumerate(trials)}


SETS = {
    "driven_slide": lambda: numbered(driven_slide(12.0, lanes=4, seconds=3.0, rate=100)),
    "hanging_load": lambda: numbered(hanging_load("creep")),
    "raw_volts": raw_volts,
    "uneven": uneven,
    "two_rates": two_rates,
    "one_long_trial": lambda: {"wander.csv": columns(one_long_trial(30.0))},
}
"""Files of each set, and what stands in their columns."""


def write(folder: Path) -> None:
    """Write the trials of all sets."""
    for name, made in SETS.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        for file, held in made().items():
            with open(folder / name / file, "w", newline="", encoding="utf-8") as target:
                writer = csv.writer(target, lineterminator="\n")
                writer.writerow(held)
                writer.writerows(
                    [f"{value:.10g}" for value in row] for row in zip(*held.values(), strict=True)
                )


if __name__ == "__main__":
    write(FROZEN)
