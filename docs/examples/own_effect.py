"""An effect of your own, in a file of ten lines: what it changes on the station."""

# %%
from pathlib import Path

import numpy as np

from pma_gym import Plant, Trial, compare, load_model
from pma_gym.effects.user_effects import load_effects

SOURCE = """
from typing import Annotated, NamedTuple
from pma_gym.effects import Effect
from pma_gym.units import Quantity

class Drag(NamedTuple):
    factor: Annotated[
        float, Quantity("N s^2/mm^2", 0, 1, "assumption: 0.02", neutral=0.0, usual=0.02)
    ]

def drag(velocity, p):
    return -p.factor * velocity * abs(velocity)

DRAG = Effect("drag", "slide_force", Drag, drag, signature="force as the square of speed")
"""
Path("drag.py").write_text(SOURCE, encoding="utf-8")
load_effects("drag.py")

# %%
time = np.arange(0.0, 4.0, 0.01)
commands = {
    "motor_voltage": 2.0 - 2.0 * np.cos(2.0 * np.pi * time),
    "pressure_command": np.full(time.size, 300e3),
}
model = load_model("station")
with_drag = model.with_effects({"drag": {"factor_n_s2_per_mm2": 0.02}})
before, after = (
    Plant(each).simulate(Trial(time, commands), noise=False) for each in (model, with_drag)
)
both = compare(before, after, ("station", "with drag"))
print(both)
assert both.rmse["contraction_mm"] > 0.1
