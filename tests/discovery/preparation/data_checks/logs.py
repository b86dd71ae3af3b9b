"""Small logs as a lab writes them, and spoilt in one way each."""

import csv

import numpy as np

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.trial import Trial
from pma_gym.discovery.preparation.data_checks import check_dataset
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

GIVEN = load_model("serres2008")
TRUTH = GIVEN.with_effects({"hysteresis": {"force_n": 20.0, "distance_mm": 3.0}})
HEADER = (
    "time_s",
    "motor_voltage_v",
    "pressure_command_kpa",
    "contraction_mm",
    "rotation_deg",
    "load_n",
    "pressure_kpa",
)


def log(period, kpa, seed, rate=100.0, seconds=6.0, truth=TRUTH):
    """Columns of a log of some pulls at one pressure, in the units of a trial's file."""
    time = np.arange(round(seconds * rate)) / rate
    volts = 2.5 * (1.0 - np.cos(2.0 * np.pi * time / period))
    asked = Trial(time, {"motor_voltage": volts, "pressure_command": 0.0 * time + 1e3 * kpa})
    read = Plant(truth).simulate(asked, seed=seed).measurements
    columns = (
        time,
        volts,
        0.0 * time + kpa,
        1e3 * read["contraction"],
        np.degrees(read["rotation"]),
        read["load"],
        read["pressure"] / 1e3,
    )
    return dict(zip(HEADER, columns, strict=True))


def logs(**options):
    """Three such logs."""
    return [log(*each, **options) for each in ((2.0, 200.0, 1), (3.5, 300.0, 2), (5.0, 400.0, 3))]


def write(folder, written, toml=None):
    """A folder of CSV files, trial0.csv and so on; NaN is an empty cell."""
    folder.mkdir(exist_ok=True)
    for number, columns in enumerate(written):
        with open(folder / f"trial{number}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            for row in zip(*columns.values(), strict=True):
                writer.writerow(["" if value != value else f"{value:.9g}" for value in row])
    if toml is not None:
        (folder / "dataset.toml").write_text(toml, encoding="utf-8")
    return folder


def checked(folder, model=GIVEN, stop=True):
    """The data set of a folder, checked."""
    return check_dataset(read_dataset(folder), model, stop)
