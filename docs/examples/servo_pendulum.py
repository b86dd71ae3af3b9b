"""A geared hobby servo swings a weight: rebuild its voltage from the log, and diagnose without gravity.

The log of the servo has the duty of its bridge as an unsigned number of 16 bit, so a negative duty
is wrapped around. Volts are duty / 885 times the supply.
"""

import csv
import sys
from pathlib import Path

HERE = Path(__file__).parent / "rigs" / "servo_pendulum"
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


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "servo_pendulum")
    write_dataset(folder)
    print(f"Written {folder}; now: pma-gym diagnose {folder}")
