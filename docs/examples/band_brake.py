"""A band brake that another drive turns to and fro: what does it take, and how much play has it?

The logs are measured, from https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash
(CC BY-SA 4.0, see `band_brake/LICENSE.txt`): a sine of 1 Hz at two amplitudes, in inches and kips.
"""

# %%
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose

RAW = Path(__file__).parent / "band_brake"

# %% Nothing is known of the brake: no force at all.
MODEL = """
schema = 1
name = "brake"
title = "Band brake, nothing known"
plant = "imposed"

[imposed_motion]
bandwidth_hz = 20

[piston_force]
area_mm2 = 0
"""

# %% The logs' own columns; the brake's force is counted against the motion.
DATASET = """
title = "Band brake, sines of 1 Hz"

[columns]
displacement_in = "contraction_command_in"
friction_force_kip = { name = "force_kip", factor = -1 }
"""


def convert(folder: Path) -> None:
    """The logs as a data set."""
    (folder / "brake.toml").write_text(MODEL)
    (folder / "dataset.toml").write_text(DATASET)
    for raw in sorted(RAW.glob("sine_*.csv")):
        copy(raw, folder)


# %%
with TemporaryDirectory() as made:
    convert(Path(made))
    diagnosis = diagnose(read_dataset(made), str(Path(made) / "brake.toml"), propose=False)

# %% The plateau is 9 to 9.8 kN; after a turn 6 to 8 mm pass before half of the force is back.
print(diagnosis.sentence)
assert {each.name for each in diagnosis.effects} == {"contact_friction", "backlash"}
contact = diagnosis.model.parameters["contact_friction"]
backlash = diagnosis.model.parameters["backlash"].width
# The bristles relax, the gap is crossed, and half of the friction is deflected again.
back_at_half = backlash + 1.5 * contact.presliding
print(f"Friction {contact.force / 1e3:.2f} kN; read off the plateau by hand: 9 to 9.8 kN")
print(f"Half of it is back after {back_at_half * 1e3:.1f} mm; by hand: 6 to 8 mm")
assert 8.5e3 < contact.force < 10.3e3
assert 6e-3 < back_at_half < 8e-3
