"""One trial of the dissertation, simulated: `python -m pma_gym.demo [PICTURE]`.

The voltages that Serres printed in 2008 drive the simulated station at 300 kPa. It prints the error
of that trial beside the error that she measured, and draws both.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import DISPLACEMENT
from pma_gym.files import OutputError, check_output, replace_file
from pma_gym.metrics import PHASE_SAMPLES, SAMPLE_RATE_HZ
from pma_gym.pages.figures import legend_below, picture, png
from pma_gym.plant.plant import Plant
from pma_gym.studies.evaluation import evaluate

PRESSURE_KPA = 300
SEED = 1


class Demonstration(NamedTuple):
    """A simulated trial beside the measured one.

    Attributes:
        trial: the simulated trial, with sensor noise.
        simulated_mm: its RMSE against the ideal line (mm).
        measured_mm: RMSE that the dissertation measured (mm; table 22).
        measured_line: slope (mm/s) and intercept (mm) of the line through the measured trial
            (table 21).
    """

    trial: Trial
    simulated_mm: float
    measured_mm: float
    measured_line: tuple[float, float]


def demonstrate(pressure_kpa: int = PRESSURE_KPA, seed: int = SEED) -> Demonstration:
    """Simulate the dissertation's displacement trial: 25 mm in 5 s, open loop.

    Args:
        pressure_kpa: one of the pressures of the dissertation's trials, gauge.
        seed: of the sensors' noise.
    Source:
        Serres 2008, tables I4-I12 (voltages), 21 and 22 (what was measured).
    """
    profile = load_table(f"I{4 + pressures('displacement').index(pressure_kpa)}")
    time = np.arange(PHASE_SAMPLES) / SAMPLE_RATE_HZ
    commands = {
        "motor_voltage": np.interp(time, profile["time_s"], profile["motor_voltage_v"]),
        "pressure_command": np.full(time.size, 1e3 * pressure_kpa),
    }
    trial = Plant("station").simulate(Trial(time, commands), noise=True, seed=seed)
    (row,) = evaluate(trial, "displacement")
    (measured,) = load_table("22").where(pressure_kpa=pressure_kpa)["rmse_mm"]
    line = load_table("21").where(pressure_kpa=pressure_kpa)
    terms = {
        str(term): float(value) for term, value in zip(line["term"], line["estimate"], strict=True)
    }
    return Demonstration(
        trial, 1e3 * row.rmse, float(measured), (terms["slope"], terms["intercept"])
    )


def draw(shown: Demonstration) -> Figure:
    """Draw extension above voltage."""
    time = shown.trial.time
    slope, intercept = shown.measured_line
    with picture(7.2, 4.6) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        ideal = 1e3 * DISPLACEMENT.reference(time)
        above.plot(time, ideal, color="#000000", linestyle=(0, (5, 3)), label="ideal: 25 mm in 5 s")
        label = f"measured in 2008 (its regression line): RMSE {shown.measured_mm:.2f} mm"
        above.plot(time, intercept + slope * time, color="#666666", linewidth=2.6, label=label)
        label = f"simulated: RMSE {shown.simulated_mm:.2f} mm"
        above.plot(time, 1e3 * shown.trial.extension, color="#D55E00", label=label)
        above.set_ylabel("extension (mm)")
        below.plot(time, shown.trial.commands["motor_voltage"], color="#0072B2")
        below.set_ylabel("motor voltage (V)")
        below.set_xlabel("time (s)")
        legend_below(drawn, above.get_lines(), 1)
        return drawn


def main(arguments: Sequence[str]) -> int:
    """Write the picture and print the two numbers; 2 for a file that cannot be written."""
    path = Path(arguments[0] if arguments else "pma-gym-demo.png")
    try:
        if len(arguments) > 1 or path.suffix.lower() != ".png":
            raise OutputError(f"give one file that ends in .png, got {' '.join(arguments)}")
        check_output(path)
        shown = demonstrate()
        replace_file(path, png(draw(shown)))
    except (OSError, OutputError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"displacement at {PRESSURE_KPA} kPa, the voltages printed in 2008, open loop")
    print(f"simulated RMSE {shown.simulated_mm:.2f} mm")
    print(f"measured RMSE {shown.measured_mm:.2f} mm (Serres 2008, table 22)")
    print(f"picture: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
