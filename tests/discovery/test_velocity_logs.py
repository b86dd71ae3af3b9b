"""A slide whose log has its speed alone is diagnosed as one whose position is logged."""

import numpy as np
import pytest

from pma_gym import Plant
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import write_trial
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.estimation.residuals import Residuals
from pma_gym.plant.model import load_model
from tests.discovery.rig_trials import FROZEN

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


def test_a_trial_begins_as_fast_as_its_readings_say():
    true = MODEL.replace(TRUE).with_effects({"coulomb_friction": DRY})
    residuals = Residuals(true, logs(), [])
    left = np.stack([each[:, 1] for each in residuals.each(residuals.start)])
    assert float(np.mean(left**2)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.campaign
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
