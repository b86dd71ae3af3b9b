"""A tensile test of a muscle, from the tester's log to what its model misses."""

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pma_gym import Plant, Trial, load_model
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose
from pma_gym.plant.model import Model

# %% What is known of the muscle: its force over pressure and length, in the tester's frame.
MODEL = """
schema = 1
name = "tensile"
title = "A muscle in a tensile tester, force laws of Serres 2008"
plant = "imposed"

[imposed_motion]
bandwidth_hz = 5

[contractile_force]
slope_n_per_kpa = 2.91
intercept_n = 44.6

[stiffness]
low_intercept_n_per_mm = 32.7
low_slope_n_per_mm_per_kpa = -0.0321
high_intercept_n_per_mm = 17.0
high_slope_n_per_mm_per_kpa = 0.0179
breakpoint_kpa = 314

[force_sensor]
bandwidth_hz = 1000
noise_n = 0.5
"""

# %% A raw log as a tester writes one: extension in mm, force in kN, pressure in bar.
DATASET = """
title = "Tensile test, cyclic, three pressures"
model = "tensile.toml"

[columns]
time = "time_s"
extension_mm = { name = "contraction_command_mm", factor = -1.0, offset = 20.0 }
force_kN = { name = "force_n", factor = 1000 }
pressure_bar = { name = "pressure_command_kpa", factor = 100 }
"""


def log(folder: Path, pressure_bar: float, seed: int) -> None:
    """One test: hold, then triangles of growing amplitude at 10 mm/s; hysteresis is hidden."""
    time = np.arange(0.0, 25.0, 0.02)
    extension = np.interp(time, [2, 3, 5, 8, 12, 17, 22], [0, 10, -10, 15, -15, 18, 0])
    known = load_model(str(folder / "tensile.toml"))
    muscle: Model = known.with_effects({"hysteresis": {"force_n": 18.0, "distance_mm": 2.0}})
    commands = {
        "contraction_command": 20e-3 - extension * 1e-3,
        "pressure_command": np.full(time.size, pressure_bar * 1e5),
    }
    force = Plant(muscle).simulate(Trial(time, commands), seed=seed).measurements["force"]
    # The tester measures its own position, with noise.
    extension += np.random.default_rng(seed).normal(0.0, 0.005, time.size)
    columns = [time, extension, force / 1e3, commands["pressure_command"] / 1e5]
    table = np.stack(columns, axis=1)
    header = "time,extension_mm,force_kN,pressure_bar"
    name = folder / f"{pressure_bar:g}bar.csv"
    np.savetxt(name, table, "%.5f", ",", header=header, comments="")


# %%
with TemporaryDirectory() as made:
    lab = Path(made)
    (lab / "tensile.toml").write_text(MODEL)
    (lab / "dataset.toml").write_text(DATASET)
    for seed, pressure in enumerate((2.0, 3.5, 5.0)):
        log(lab, pressure, seed)
    diagnosis = diagnose(read_dataset(lab), str(lab / "tensile.toml"), propose=False)

# %%
print(diagnosis.verdict)
print(diagnosis.sentence)
(missing,) = diagnosis.effects
size = missing.parameters["force_n"]
print(f"{missing.name}: {size.value:.1f} N (95 %: {size.low:.1f} to {size.high:.1f}), hidden 18 N")
assert missing.name == "hysteresis" and abs(size.value - 18.0) < 1.0
