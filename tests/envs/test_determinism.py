"""The same seed gives the same bits; what is drawn stays within its bounds."""

import subprocess
import sys

import numpy as np
import pytest

from pma_gym.codegen.machine import native
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.parameter_rows import Note
from pma_gym.plant.statics import muscle_force
from pma_gym.tasks import CORNERS, FORCE_TOLERANCE

EPISODE = """
import hashlib
from pma_gym.envs import PMAEnv
env = PMAEnv(model="serres2008", randomisation="varied")
digest = hashlib.sha256()
for seed in (5, None):
    observation, _ = env.reset(seed=seed)
    digest.update(observation.tobytes())
    for k in range(100):
        observation, reward, *_, info = env.step(env.action(0.02 * k))
        digest.update(observation.tobytes())
        digest.update(repr((reward, info)).encode())
print(digest.hexdigest())
"""


def bits(env: PMAEnv, seed: int | None, options: dict | None = None) -> bytes:
    parts = [env.reset(seed=seed, options=options)[0].tobytes()]
    for k in range(60):
        observation, reward, *_ = env.step(env.action(0.03 * k))
        parts.append(observation.tobytes() + np.float64(reward).tobytes())
    return b"".join(parts)


@pytest.mark.parametrize(
    ("model", "randomisation"),
    [
        ("serres2008", "none"),
        ("station", "intervals"),
        ("cascade", "varied"),
    ],
)
def test_same_seed_same_bits(make, model, randomisation):
    options = {"randomisation": randomisation, "pressure_kpa": "random", "model": model}
    first, second = make(**options), make(**options)
    assert bits(first, 7) == bits(second, 7)
    assert bits(first, None) == bits(second, None)
    assert bits(first, 7) != bits(second, 8)


def test_same_seed_same_bits_in_other_processes():
    made = [subprocess.Popen([sys.executable, "-c", EPISODE], stdout=-1) for _ in range(2)]
    first, second = (process.communicate()[0] for process in made)
    assert first == second and len(first) == 65


def test_all_passes_of_the_compiler_give_the_bits_of_few(make, monkeypatch, tmp_path):
    few = bits(make(randomisation="intervals"), 7)
    monkeypatch.setenv("PMA_GYM_CACHE", str(tmp_path))
    monkeypatch.setattr(native, "_libraries", {})
    monkeypatch.setattr(native, "_PASSES", None)
    assert bits(make(randomisation="intervals"), 7) == few
    assert list(tmp_path.rglob("*.o"))


def test_one_computed_as_a_pair_has_the_bits_of_one_alone(make, monkeypatch):
    rows = []
    for paired in (False, True):
        for module in ("engine_memory", "cpu.step_writer"):
            monkeypatch.setattr(f"pma_gym.engine.{module}.pairs", lambda width, p=paired: p)
        rows.append(bits(make(preview=1, pressure_kpa=300), 7))
    assert rows[0] == rows[1]


def test_without_noise_the_seed_does_not_matter(make):
    assert bits(make(noise=False), 1) == bits(make(noise=False), 2)
    assert bits(make(noise=True), 1) != bits(make(noise=True), 2)


@pytest.fixture
def uncertain() -> Model:
    """A model with an interval on a force, a damping and a drive, one up to the bound."""
    model = load_model("serres2008")
    bound = model.effects["drive"].quantities["gain"].upper
    intervals = {
        "contractile_force.slope_n_per_kpa": Note("test", 2.7, 3.1),
        "damping.contracting_n_s_per_mm": Note("test", 2.0, 4.0),
        "drive.gain_n_per_v": Note("test", 90.0, 1.5 * bound),
    }
    return Model(
        model.name, model.title, model.plant, model.parameters, dict(model.notes) | intervals
    )


@pytest.mark.parametrize("randomisation", ["intervals", "varied"])
def test_drawn_parameters_lie_within_their_bounds_and_vary(make, uncertain, randomisation):
    env = make(model=uncertain, randomisation=randomisation)
    slopes = []
    for seed in range(40):
        env.reset(seed=seed)
        drawn = env.plant.model
        # Controllers get the nominal station.
        assert env.station.model == uncertain and drawn.parameters != uncertain.parameters
        slopes.append(drawn.values_in_files("contractile_force")["slope_n_per_kpa"])
        for effect in drawn.effects.values():
            effect.parse(drawn.values_in_files(effect.name))
        assert drawn.parameters["stiffness"].breakpoint == pytest.approx(314e3)
        assert drawn.parameters["limits"] == uncertain.parameters["limits"]
    share = 1.2 if randomisation == "varied" else 1.0
    assert 2.7 / share <= min(slopes) < 2.85 < 2.95 < max(slopes) <= 3.1 * share


def test_intervals_are_met_in_all_their_width(make, uncertain):
    env = make(model=uncertain, randomisation="intervals")
    values = []
    for _ in range(200):
        env.reset(seed=None if values else 0)
        values.append(env.plant.model.values_in_files("damping")["contracting_n_s_per_mm"])
    assert 2.0 <= min(values) < 2.1 and 3.9 < max(values) <= 4.0
    # A uniform draw's mean: 3 with a standard error of 0.04.
    assert np.mean(values) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize(
    ("task", "randomisation"), [("displacement", "intervals"), ("rotation", "varied")]
)
def test_every_drawn_station_can_begin_its_trials(make, task, randomisation):
    options = {"model": "station", "randomisation": randomisation}
    env = make(task, **options, pressure_kpa=[275.0, 575.0])
    starts, forces = [], []
    for _ in range(40):
        env.reset(seed=None if starts else 0)
        nominal = env.nominal_plant.settle(0.0, pressure=env.pressure).zero_contraction
        starts.append(env.condition.zero_contraction - nominal)
        *_, terminated, _, _ = env.step(env.action(0.0))
        assert not terminated
        difference = muscle_force(env.plant.model)(*CORNERS.T)
        forces.append(np.abs(difference - muscle_force(env.station.model)(*CORNERS.T)).max())
    # Where the muscle gives no force, scaling it moves nothing.
    assert 0.3e-3 < np.std(starts) and np.abs(starts).max() < 4e-3
    if randomisation == "intervals":
        assert 5.0 < max(forces) <= FORCE_TOLERANCE


def test_varied_scales_force_as_a_whole(make):
    env = make(model="serres2008", randomisation="varied")
    nominal = env.nominal_plant.model
    env.reset(seed=2)
    drawn = env.plant.model
    ratios = {
        path: drawn.values_in_files(effect)[file_key] / nominal.values_in_files(effect)[file_key]
        for path in nominal.paths()
        for effect, _, file_key in [path.partition(".")]
        if nominal.values_in_files(effect)[file_key]
    }
    force = {
        round(ratios[p], 9)
        for p in ratios
        if p.startswith(("contractile", "stiffness")) and "_n" in p
    }
    assert len(force) == 1 and 0.8 <= force.pop() <= 1.2
    assert ratios["stiffness.breakpoint_kpa"] == ratios["cable.stiffness_n_per_mm"] == 1.0
