"""An axis of a foreign simulator, as a lab logs it: 25 s at 1 kHz, closed loop, an encoder of 1 um.

MuJoCo moves it, with dry friction as hard as it makes it and damping that is larger one way. Its
model has the mass and the smaller damping alone.

A slide whose log has its speed alone is diagnosed as one whose position is logged.
"""

import tomllib

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs.simulators.mujoco_axis import mujoco
from pma_gym import Plant
from pma_gym.data.datasets.dataset import Dataset, NamedTrial, read_dataset
from pma_gym.data.files.trial_files import write_trial
from pma_gym.data.trial import Trial
from pma_gym.discovery.workflow import diagnose
from pma_gym.plant.model import load_model, parse_model
from tests.discovery.rig_trials import FROZEN

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

AXIS = f"""
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
    diagnosis = diagnose(dataset, parse_model(tomllib.loads(AXIS)), propose=False)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    sizes = {effect.name: effect.parameters for effect in diagnosis.effects}
    assert set(sizes) == {"coulomb_friction", "directional_damping"}, diagnosis.sentence
    assert sizes["coulomb_friction"]["dynamic_n"].value == pytest.approx(FRICTION_N, rel=0.05)
    difference = sizes["directional_damping"]["difference_n_s_per_mm"].value
    assert difference == pytest.approx(1e-3 * ONE_WAY, rel=0.05)
    every = [each for numbers in sizes.values() for each in numbers.values()]
    assert not any(each.limit for each in every)


NOISE = 1e-3
MODEL = load_model(str(FROZEN / "driven_slide" / "model.toml")).with_effects(
    {"tachometer": {"bandwidth_hz": 1000.0, "noise_mm_per_s": 1e3 * NOISE}}
)
DRY_N = 12.0
TRUE = {"slide.mass_kg": 5.3, "symmetric_damping.intercept_n_s_per_mm": 0.046}
DRY = {
    "static_n": DRY_N,
    "dynamic_n": DRY_N,
    "stribeck_speed_mm_per_s": 5.0,
    "presliding_um": 10.0,
}


def logs(count=2, seconds=1.0, rate=150.0):
    """Speeds of a rubbing slide under sums of sines, begun in motion, each measured twice."""
    generator, trials = np.random.default_rng(3), []
    rubbing = MODEL.replace(TRUE).with_effects({"coulomb_friction": DRY})
    for _ in range(count):
        time = np.arange(0.0, seconds, 1.0 / rate)
        waves = [(generator.uniform(15, 40), f, generator.uniform(0, 6)) for f in (0.4, 1.1, 2.3)]
        tones = [size * np.sin(2 * np.pi * f * time + phase) for size, f, phase in waves]
        load = np.sum(tones, axis=0)
        start = {"start.velocity_mm_per_s": generator.uniform(-100.0, 100.0)}
        asked = Trial(time, {"load_command": load})
        exact = Plant(rubbing.replace(start)).simulate(asked, noise=False).measurements["velocity"]
        for _ in range(2):
            noise = NOISE * generator.standard_normal(time.size)
            trials.append(Trial(time, asked.commands, {"velocity": exact + noise}))
    return trials


def test_dry_friction_is_found_by_speed_alone_within_its_interval():
    diagnosis = diagnose(logs(), MODEL, propose=False)
    (effect,) = diagnosis.effects
    assert effect.name == "coulomb_friction", diagnosis.sentence
    dynamic = effect.parameters["dynamic_n"]
    assert dynamic.low and dynamic.high and dynamic.low < DRY_N < dynamic.high
    assert dynamic.high - dynamic.low < 0.1 * DRY_N
    assert diagnosis.model.parameters["slide"].mass == pytest.approx(5.3, rel=0.01)
    assert "velocity" in diagnosis.sentence


def test_metres_a_second_and_a_lab_s_own_name_are_read(tmp_path):
    (trial, *_) = logs(count=1, seconds=0.1)
    write_trial(trial, tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_text(encoding="utf-8")
    assert "velocity_mm_per_s" in text.splitlines()[0]
    named = text.replace("velocity_mm_per_s", "Tacho [mm/s]")
    (tmp_path / "log.csv").write_text(named, encoding="utf-8")
    (tmp_path / "dataset.toml").write_text(
        '[columns]\n"Tacho [mm/s]" = { name = "velocity_m_per_s", factor = 0.001 }\n',
        encoding="utf-8",
    )
    (read,) = read_dataset(tmp_path).trials
    np.testing.assert_allclose(
        read.trial.measurements["velocity"], trial.measurements["velocity"], rtol=1e-12
    )
