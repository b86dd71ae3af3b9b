"""A pneumatic cylinder pushed and pulled at constant pressure: what do its seals take?

The logs are measured, from https://github.com/EvaZillen/3D-printed-pneumatic-actuator (CC0): a rod
of a cylinder of 25 mm bore that another drive moves at 10 to 15 mm/s, at 1, 3 and 7 bar.
"""

# %%
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose

RAW = Path(__file__).parent / "cylinder_seal"
BORE_MM = 25.0

# %% What is known: the bore. Nothing rubs yet.
MODEL = f"""
schema = 1
name = "cylinder"
title = "Cylinder of 25 mm bore, without friction"
plant = "imposed"

[imposed_motion]
bandwidth_hz = 10

[piston_force]
area_mm2 = {pi / 4.0 * BORE_MM**2:.4g}

[force_sensor]
bandwidth_hz = 1000
noise_n = 0.2
"""

# %% The logs have no header: ms, three voltages, then laser (mm), pressure (bar), force (N).
DATASET = """
title = "Seals of a cylinder, constant pressure"

[columns]
ms = { name = "time_s", factor = 0.001 }
laser_mm = { name = "contraction_command_mm", factor = -1 }  # it grows as the rod goes in
bar = { name = "pressure_command_kpa", factor = 100 }
force = "force_n"
"""


def convert(folder: Path) -> None:
    """The logs as a data set."""
    (folder / "cylinder.toml").write_text(MODEL)
    (folder / "dataset.toml").write_text(DATASET)
    for raw in sorted(RAW.glob("seal_*.txt")):
        columns = np.loadtxt(raw, usecols=(0, 4, 5, 6))
        header = "ms,laser_mm,bar,force"
        np.savetxt(folder / f"{raw.stem}.csv", columns, "%.3f", ",", header=header, comments="")


# %%
with TemporaryDirectory() as made:
    convert(Path(made))
    diagnosis = diagnose(read_dataset(made), str(Path(made) / "cylinder.toml"), propose=False)

# %% Half the loop of force over position is the friction, at each pressure.
print(diagnosis.sentence)
assert [each.name for each in diagnosis.effects] == ["contact_friction", "pressure_friction"]
friction = diagnosis.model.parameters["contact_friction"].force
slope = diagnosis.model.parameters["pressure_friction"].slope
for bar, by_hand in ((1.0, 3.9), (3.0, 5.4), (7.0, 7.2)):
    half = friction + slope * bar * 1e5
    print(f"{bar:g} bar: friction {half:.1f} N; half the loop, read off by hand: {by_hand} N")
    assert abs(half / by_hand - 1.0) < 0.15
