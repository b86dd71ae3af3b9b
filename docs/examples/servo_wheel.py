"""A small servo whose voltage nobody logged: rebuild it from the law of its loop, and diagnose.

The log (https://github.com/carlos2219/qube-servo-motor-position-control, MIT) has the reference and
the angle of a direct-drive motor, 500 rows a second. Its loop gives volts = KP (reference - angle)
- KV speed; of KP it is known only that it lies between 3.4 and 5.2 V/rad. A voltage that is rebuilt
so badly cannot tell a little friction from a gain that is off, and an honest answer says so.
"""

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from pma_gym.data.datasets.dataset import read_dataset

RAW = Path(__file__).parent / "servo_wheel" / "square_wave.csv"
KP, KV = 4.3, 0.12
"""Gains of the loop (V/rad, V s/rad): KP is the middle of what is known."""

RATE, SMOOTHED = 500.0, 9
"""Rows a second, and over how many of them the speed is taken: an encoder of 0.18 deg is coarse."""

DATASET = """title = "A direct-drive servo follows a square wave; its voltage is rebuilt"
model = "model.toml"
"""

MODEL = """schema = 1
name = "servo_wheel"
title = "Direct-drive servo, as its data sheet has it; without friction"
plant = "joint"

[dc_motor]
torque_constant_n_m_per_a = 0.0422
resistance_ohm = 7.5

[inertia]
inertia_kg_m2 = 1.8e-5

[joint_start]
angle_deg = 0.0
spin_deg_per_s = 0.0
"""


def volts(reference: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Voltage that the loop gives, from the reference and the angle (rad).

    >>> bool(np.allclose(volts(np.full(20, 0.5), np.zeros(20)), 2.15))
    True
    """
    speed = np.asarray(savgol_filter(angle, SMOOTHED, 2, deriv=1, delta=1.0 / RATE))
    return KP * (reference - angle) - KV * speed


def write_dataset(folder: Path) -> None:
    """Write the log as a data set: winding voltage and angle."""
    folder.mkdir(parents=True, exist_ok=True)
    with RAW.open() as log:
        rows = [[float(value) for value in row.values()] for row in csv.DictReader(log)]
    time, reference, angle = np.array(rows).T
    columns = np.column_stack([time, volts(reference, angle), angle])
    header = "time_s,winding_voltage_v,angle_rad"
    np.savetxt(folder / RAW.name, columns, "%.6f", ",", header=header, comments="")
    (folder / "dataset.toml").write_text(DATASET)
    (folder / "model.toml").write_text(MODEL)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "servo_wheel_data")
write_dataset(folder)
for each in read_dataset(folder).trials:
    trial = each.trial
    largest = abs(trial.commands["winding_voltage"]).max()
    swing = abs(trial.measurements["angle"]).max()
    print(f"{each.name}: {len(trial)} rows, up to {largest:.2f} V and {swing:.2f} rad")
print(f"Written {folder}; now: pma-gym diagnose {folder}")
