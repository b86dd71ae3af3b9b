"""An axis of a foreign simulator, as a lab logs it: 25 s at 1 kHz, closed loop, an encoder of 1 um.

MuJoCo moves it, with dry friction as hard as it makes it and damping that is larger one way. Its
model has the mass and the smaller damping alone.
"""

import tomllib

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs.simulators.mujoco_axis import mujoco
from pma_gym.data.datasets.dataset import Dataset, NamedTrial
from pma_gym.data.trial import Trial
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.model import parse_model

MASS_KG, FRICTION_N, DAMPING, ONE_WAY = 3.0, 8.0, 20.0, 12.0
"""Of the axis; damping and what it has more one way in N s/m."""

RATE_HZ, ROWS, STEPS = 1000, 25_000, 50
COUNT_M, BIT_N, MOST_N = 1e-6, 0.01, 300.0
TONES = ((0.3, 0.04), (0.8, 0.02), (1.7, 0.008), (3.0, 0.003))
"""Of the reference: frequency (Hz), amplitude (m)."""

STIFFNESS, RATE_GAIN = 4000.0, 120.0
"""Of the loop (N/m, N s/m)."""

WORLD = f"""
<mujoco>
  <option timestep="{1.0 / RATE_HZ / STEPS}" gravity="0 0 0" integrator="implicit"/>
  <worldbody>
    <body>
      <joint name="x" type="slide" axis="1 0 0" damping="{DAMPING}" frictionloss="{FRICTION_N}"
        solreffriction="0.0004 1"/>
      <geom type="box" size="0.05 0.05 0.05" mass="{MASS_KG}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""

MODEL = f"""
schema = 1
name = "axis"
title = "An axis as its data sheet has it"
plant = "slide"

[two_way_drive]
gain_n_per_v = 100
middle_v = 5

[slide]
mass_kg = {MASS_KG}

[symmetric_damping]
intercept_n_s_per_mm = {1e-3 * DAMPING}
slope_n_s_per_mm_per_kpa = 0.0

[start]
contraction_mm = 0.0
velocity_mm_per_s = 0.0

[lvdt]
bandwidth_hz = 10000
noise_mm = 0.0003
"""


def logged():
    """Positions that the encoder reads (m), and forces that the loop commands (N)."""
    library = mujoco()
    model = library.MjModel.from_xml_string(WORLD)
    data = library.MjData(model)
    time = np.arange(ROWS) / RATE_HZ
    phases = np.random.default_rng(1).uniform(0.0, 6.0, len(TONES))
    waves = sum(
        size * (np.sin(2.0 * np.pi * hertz * time + phase) - np.sin(phase))
        for (hertz, size), phase in zip(TONES, phases, strict=True)
    )
    asked = waves * np.clip(time, 0.0, 1.0) ** 2
    speed = np.gradient(asked, time)
    read, force = np.empty(ROWS), np.empty(ROWS)
    for row in range(ROWS):
        read[row] = COUNT_M * round(data.qpos[0] / COUNT_M)
        moving = RATE_HZ * (read[row] - read[row - 1]) if row else 0.0
        wanted = STIFFNESS * (asked[row] - read[row]) + RATE_GAIN * (speed[row] - moving)
        force[row] = BIT_N * round(min(max(wanted, -MOST_N), MOST_N) / BIT_N)
        for _ in range(STEPS):
            data.qfrc_applied[0] = force[row] - ONE_WAY * max(data.qvel[0], 0.0)
            library.mj_step(model, data)
    return time, read, force


@pytest.mark.campaign
def test_friction_and_damping_by_direction_of_a_foreign_axis_are_named_with_their_sizes():
    time, read, force = logged()
    # The load pulls a slide out, against its contraction.
    trial = Trial(time, {"load_command": -force}, {"contraction": read})
    dataset = Dataset("Axis", None, (NamedTrial("run", trial),), tolerance={"contraction": 2e-5})
    diagnosis = diagnose(dataset, parse_model(tomllib.loads(MODEL)), propose=False)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    sizes = {effect.name: effect.parameters for effect in diagnosis.effects}
    assert set(sizes) == {"coulomb_friction", "directional_damping"}, diagnosis.sentence
    assert sizes["coulomb_friction"]["dynamic_n"].value == pytest.approx(FRICTION_N, rel=0.05)
    difference = sizes["directional_damping"]["difference_n_s_per_mm"].value
    assert difference == pytest.approx(1e-3 * ONE_WAY, rel=0.05)
    every = [each for numbers in sizes.values() for each in numbers.values()]
    assert not any(each.limit for each in every)
