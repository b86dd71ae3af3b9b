"""A geared servo that swings a weight: rebuild its voltage from the log, as a data set for a joint.

The log has the duty of the servo's bridge as an unsigned number of 16 bit, so a negative duty is
wrapped around; volts are duty / 885 times the supply. The model has no gravity: a diagnosis is to
name it. Logs: Rhoban/bam, Apache-2.0; 0.49 kg on 0.1 m.
"""

import csv
import sys
from pathlib import Path

from pma_gym.data.datasets.dataset import read_dataset

HERE = Path(__file__).parent / "servo_pendulum"
FULL_DUTY, WRAPPED, HALF = 885, 65536, 32767

DATASET = """title = "A geared servo swings 0.49 kg on 0.1 m; gravity is left out of the model"
model = "model.toml"
"""

MODEL = """schema = 1
name = "servo_pendulum"
title = "Geared servo, 0.49 kg on 0.1 m, as its data sheet has it; without gravity"
plant = "joint"

[dc_motor]
torque_constant_n_m_per_a = 0.387
resistance_ohm = 4.0

[inertia]
inertia_kg_m2 = 0.0067

[joint_start]
angle_deg = 0.0
spin_deg_per_s = 0.0
"""


def volts(duty: int, supply: float) -> float:
    """Voltage at the winding from the duty as it was logged.

    >>> volts(885, 7.4), volts(65536 - 885, 7.4)
    (7.4, -7.4)
    """
    signed = duty - WRAPPED if duty > HALF else duty
    return signed / FULL_DUTY * supply


def write_dataset(folder: Path) -> None:
    """Write the six logs as a data set: winding voltage and angle."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(HERE.glob("*.csv")):
        with path.open() as log, (folder / path.name).open("w") as out:
            out.write("time_s,winding_voltage_v,angle_rad\n")
            for row in csv.DictReader(log):
                voltage = volts(int(row["pwm_raw"]), float(row["supply_v"]))
                out.write(f"{row['t_s']},{voltage:.4f},{row['angle_rad']}\n")
    (folder / "dataset.toml").write_text(DATASET)
    (folder / "model.toml").write_text(MODEL)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "servo_pendulum_data")
write_dataset(folder)
for each in read_dataset(folder).trials:
    trial = each.trial
    largest = abs(trial.commands["winding_voltage"]).max()
    swing = abs(trial.measurements["angle"]).max()
    print(f"{each.name}: {len(trial)} rows, up to {largest:.2f} V and {swing:.2f} rad")
print(f"Written {folder}; now: pma-gym diagnose {folder}")
