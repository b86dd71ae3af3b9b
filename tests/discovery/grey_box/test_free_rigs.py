"""Diagnoses of slides and joints of another simulator: what is wrong with them is known."""

import inspect
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from math import cos, exp, radians
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.hidden_effects.rigs import lab
from benchmarks.hidden_effects.rigs.laws import PositionFriction
from pma_gym import Plant
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose, refit
from pma_gym.discovery.grey_box.latent_law import latent_line, line_over_position
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.proposal import Proposal
from pma_gym.effects import CATALOGUE
from pma_gym.effects.user_effects import load_effects
from pma_gym.estimation.innovations import Point
from pma_gym.estimation.logged import Logged
from pma_gym.estimation.smoother import Smoothed, smoothed
from pma_gym.plant.model import Model
from tests.estimation.linear_slide import box

RATE_HZ, SUBSTEPS = 100, 50

RIGS = {
    # Inertia, damping, friction; controller; amplitudes of the reference; noise; command; reading.
    "slide": (5.0, 50.0, 12.0, (2000.0, 150.0), 60e-3, 2e-5, "load_command", "contraction"),
    "joint": (0.01, 0.05, 0.1, (4.0, 0.3), 0.6, 4e-4, "torque_command", "angle"),
}
"""Each in SI."""


def logs(
    plant,
    seconds=4.0,
    begin=0.0,
    friction=(1.0, 1.0, 1.0),
    gain=(1.0, 1.0, 1.0),
    seed=1,
    bump=0.0,
    drive=lambda force, position: force,
    brake=lambda position: 0.0,
):
    """Three trials of a rig that a controller moves along sums of sines, from a time on.

    Friction and gain of each trial are in shares of the rig's own. Friction is an impulse that at
    most stops the rig. A bump of force lies about 0.2 m or rad. `drive` is what a drive makes of a
    command at a position, `brake` what damps more there.
    """
    inertia, damping, dry, (stiffness, rate_gain), size, noise, command, reading = RIGS[plant]
    generator, trials, step = np.random.default_rng(seed), [], 1.0 / RATE_HZ / SUBSTEPS
    pull = -1.0 if plant == "slide" else 1.0
    for k in range(3):
        rows = round((begin + seconds) * RATE_HZ)
        time = np.arange(rows) / RATE_HZ
        phases = generator.uniform(0.0, 6.0, 3)
        tones = zip((0.5, 1.3, 2.7), (1.0, 0.4, 0.15), phases, strict=True)
        asked = sum(a * size * (np.sin(6.283 * f * time + p) - np.sin(p)) for f, a, p in tones)
        asked *= np.minimum(time, 1.0) ** 2
        errors = (noise * generator.standard_normal(rows)).tolist()
        most, kick = friction[k] * dry * step / inertia, step / inertia
        # Of order 2: damping takes the mean speed of a step, forces act in the middle of its way.
        position = speed = before = wish = 0.0
        read, forces = [], []
        for now, error in zip(asked.tolist(), errors, strict=True):
            seen = position + error
            force = stiffness * (now - seen) + rate_gain * RATE_HZ * (now - wish - seen + before)
            before, wish = seen, now
            read.append(seen)
            forces.append(force)
            for _ in range(SUBSTEPS):
                former, middle = speed, position + 0.5 * step * speed
                hill = bump * exp(-50.0 * (middle - 0.2) ** 2)
                lost = 0.5 * kick * (damping + brake(middle))
                push = kick * (gain[k] * drive(force, middle) + hill)
                speed = (speed * (1.0 - lost) + push) / (1.0 + lost)
                speed -= min(max(speed, -most), most)
                position += 0.5 * step * (former + speed)
        cut = slice(round(begin * RATE_HZ), None)
        log = {reading: np.array(read[cut])}
        trials.append(Trial(time[: len(read[cut])], {command: pull * np.array(forces[cut])}, log))
    return trials


def model(plant, inertia=1.05, presliding=None):
    """A rig's data sheet, with friction of a presliding distance (file unit) or none."""
    mass, damping, dry, *_ = RIGS[plant]
    if plant == "slide":
        tables = {
            "two_way_drive": {"gain_n_per_v": 100.0, "middle_v": 5.0},
            "slide": {"mass_kg": inertia * mass},
            "symmetric_damping": {
                "intercept_n_s_per_mm": 1e-3 * damping,
                "slope_n_s_per_mm_per_kpa": 0.0,
            },
            "start": {"contraction_mm": 0.0, "velocity_mm_per_s": 0.0},
            "lvdt": {"bandwidth_hz": 1e5, "noise_mm": 0.01},
        }
        friction = {
            "static_n": dry,
            "dynamic_n": dry,
            "stribeck_speed_mm_per_s": 5.0,
            "presliding_um": presliding,
        }
    else:
        tables = {
            "torque_drive": {"gain": 1.0},
            "inertia": {"inertia_kg_m2": inertia * mass},
            "joint_damping": {"coefficient_n_m_s": damping},
            "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
            "encoder": {"bandwidth_hz": 1e5, "noise_deg": 0.01},
        }
        friction = {
            "static_n_m": dry,
            "dynamic_n_m": dry,
            "stribeck_speed_deg_per_s": 5.0,
            "presliding_deg": presliding,
        }
    if presliding is not None:
        tables[DRY[plant]] = friction
    return Model(plant, plant, plant, {n: CATALOGUE[n].parse(t) for n, t in tables.items()})


DRY = {"slide": "coulomb_friction", "joint": "joint_friction"}
SIZE = {"slide": "dynamic_n", "joint": "dynamic_n_m"}
INERTIA = {"slide": "slide.mass_kg", "joint": "inertia.inertia_kg_m2"}
NEAR = {"slide": 10.0, "joint": 0.1}
"""Presliding distance, in its file unit; the simulator's friction has none."""


@cache
def diagnosed(plant, presliding, **kind):
    """The diagnosis of two seconds of each of three trials."""
    return diagnose(logs(plant, 2.0, **kind), model(plant, presliding=presliding), propose=False)


def inertia_of(diagnosis, plant):
    """What the diagnosis takes the inertia for, as a share of the rig's own."""
    return diagnosis.parameters[INERTIA[plant]].now.value / RIGS[plant][0]


@pytest.mark.parametrize(
    ("plant", "begin"),
    [
        pytest.param("slide", 0.0, marks=pytest.mark.campaign),
        ("slide", 1.37),
        ("joint", 0.0),
        pytest.param("joint", 1.37, marks=pytest.mark.campaign),
    ],
)
def test_a_rig_that_hides_nothing_lacks_no_effect_however_it_slips_or_begins(plant, begin):
    presliding = NEAR[plant] if begin else 5.0 * NEAR[plant]
    diagnosis = diagnosed(plant, presliding, begin=begin)
    assert diagnosis.verdict in ("parameters", "undecidable"), diagnosis.sentence
    assert not diagnosis.effects
    assert inertia_of(diagnosis, plant) == pytest.approx(1.0, rel=0.02)


@pytest.mark.campaign
def test_friction_that_one_trial_alone_has_is_said_with_its_trial_and_size():
    diagnosis = diagnosed("slide", NEAR["slide"], friction=(1.0, 1.0 + 10.0 / 12.0, 1.0))
    said = re.search(r"(trial \d) alone needs coulomb_friction\.\w+ ([\d.]+) N", diagnosis.sentence)
    assert said, diagnosis.sentence
    assert said[1] == "trial 2" and float(said[2]) == pytest.approx(22.0, rel=0.05)
    assert inertia_of(diagnosis, "slide") == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize(
    ("plant", "gain", "name", "unit", "command"),
    [
        pytest.param(
            *("slide", 100.0, "two_way_drive.gain_n_per_v", " N/V", "motor voltage (V)"),
            marks=pytest.mark.campaign,
        ),
        ("joint", 1.0, "torque_drive.gain", "", "torque command (N m)"),
    ],
)
def test_a_drive_that_weakens_from_trial_to_trial_is_said_with_its_size(
    plant, gain, name, unit, command
):
    diagnosis = diagnosed(plant, NEAR[plant], gain=(1.02, 1.0, 0.98))
    said = re.search(rf"{name} falls by .*?\((-[\d.]+){unit} \(95 %", diagnosis.sentence)
    assert said and not diagnosis.effects, diagnosis.sentence
    assert float(said[1]) == pytest.approx(-0.02 * gain, abs=0.003 * gain)
    # Before, the latent force is what the drive has too much or too little of; after, nothing.
    forces = [trial.latent for trial in diagnosis.trials]
    # A slide's contraction falls where its load rises.
    middle, way = (5.0, -1.0) if plant == "slide" else (0.0, 1.0)
    for force, share in zip(forces, (0.02, 0.0, -0.02), strict=True):
        load = way * gain * (force.over[command] - middle)
        assert np.polyfit(load, force.before, 1)[0] == pytest.approx(share, abs=0.003)
        assert np.std(force.after) < 0.001 * np.std(load)


@pytest.mark.campaign
@pytest.mark.parametrize("plant", ["slide", "joint"])
def test_dry_friction_that_the_model_lacks_is_named_with_its_size(plant):
    diagnosis = diagnosed(plant, None)
    sizes = {effect.name: effect.parameters for effect in diagnosis.effects}
    assert sizes[DRY[plant]][SIZE[plant]].value == pytest.approx(RIGS[plant][2], rel=0.05)
    assert inertia_of(diagnosis, plant) == pytest.approx(1.0, rel=0.02)
    assert diagnosis.verdict == "effect" and set(sizes) == {DRY[plant]}, diagnosis.sentence


class Uneven(lab.Laboratory):
    """A case of the lab whose dry friction grows by half over half of the stroke."""

    def effects(self, i):
        return (PositionFriction(self.friction, 0.5 / self.campaign.rig.travel),)


def test_numbers_of_a_rig_whose_friction_gives_way_at_once_are_as_sure_as_they_say(tmp_path):
    """With a presliding distance of 1e-5 deg at least its friction is 5 standard errors off."""
    hidden = lab.laboratory(223606798, 2, "nothing")
    for file, text in hidden.texts().items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    diagnosis = refit(read_dataset(tmp_path), tmp_path / "model.toml")
    rig = hidden.campaign.rig
    true = {
        "joint_friction.static_n_m": hidden.friction,
        "inertia.inertia_kg_m2": rig.inertia,
        "joint_damping.coefficient_n_m_s": rig.damping,
    }
    for path, number in true.items():
        now = diagnosis.parameters[path].now
        assert abs(now.value - number) < 0.5 * 1.5 * (now.high - now.low), (path, now, number)


@pytest.mark.campaign
def test_a_jammed_trial_is_said_without_what_stood_in_for_it(tmp_path):
    hidden = lab.laboratory(911, 1, "one_trial")
    for file, text in hidden.texts().items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    diagnosis = diagnose(read_dataset(tmp_path), tmp_path / "model.toml", propose=False)
    assert not diagnosis.effects, diagnosis.sentence
    said = re.search(
        r"run_02.csv alone needs coulomb_friction.static_n ([\d.]+) N", diagnosis.sentence
    )
    jammed = hidden.friction * (1.0 + hidden.trouble.size)
    assert said and float(said[1]) == pytest.approx(jammed, rel=2e-4), diagnosis.sentence


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("seed", "number", "name"),
    [(903, 5, "position_friction"), (902, 2, "joint_position_friction")],
)
def test_friction_that_grows_along_the_stroke_is_named_with_its_slope(seed, number, name, tmp_path):
    hidden = Uneven(**vars(lab.laboratory(seed, number, "nothing")))
    for file, text in hidden.texts().items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    diagnosis = diagnose(read_dataset(tmp_path), tmp_path / "model.toml", propose=False)
    assert diagnosis.verdict == "effect", diagnosis.sentence
    assert [effect.name for effect in diagnosis.effects] == [name], diagnosis.sentence
    ((key, size),) = diagnosis.effects[0].parameters.items()
    slope = CATALOGUE[name].quantities["slope"].from_si(hidden.effects(0)[0].slope)
    assert size.low < slope < size.high, (key, size)


def test_a_rival_of_an_effect_is_written_with_its_fit():
    """A small swing does not tell a spring from a weight, both as strong."""
    tables = {
        "torque_drive": {"gain": 1.0},
        "joint_damping": {"coefficient_n_m_s": 0.02},
        "inertia": {"inertia_kg_m2": 0.005},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 500.0, "noise_deg": 0.02},
    }
    free = Model("arm", "arm", "joint", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})
    hidden = Plant(free.with_effects({"joint_weight": {"moment_n_m": 0.2, "offset_deg": 0.0}}))
    trials, time, generator = [], np.arange(150) / 50.0, np.random.default_rng(0)
    for torque, rate in ((0.006, 5.0), (0.008, 3.0), (0.005, 8.0)):
        asked = torque * np.sin(rate * time) + 0.5 * torque * np.sin(2.3 * rate * time)
        swing = hidden.simulate(Trial(time, {"torque_command": asked}))
        read = swing.measurements["angle"] + 4e-3 * generator.standard_normal(time.size)
        trials.append(Trial(time, swing.commands, {"angle": read}))
    diagnosis = diagnose(trials, free, propose=False)
    sizes = {"joint_weight": "moment_n_m", "joint_spring": "stiffness_n_m_per_rad"}
    ((effect,), (rival,)) = diagnosis.effects, diagnosis.rivals
    assert {effect.name, rival.name} == set(sizes) and effect.confused_with == (rival.name,)
    size = f"{rival.name}.{sizes[rival.name]}"
    assert rival.values[size] == pytest.approx(0.2, rel=0.1)
    assert rival.values[f"{effect.name}.{sizes[effect.name]}"] == 0.0
    either = diagnosis.model.with_effects(rival.absent)
    assert either.replace(rival.values).parameters[rival.name] != either.parameters[rival.name]
    assert {size, "inertia.inertia_kg_m2"} < set(rival.covariance.parameters)
    known, own = diagnosis.covariance, diagnosis.parameters["inertia.inertia_kg_m2"].now
    error = known.deviations[known.parameters.index("inertia.inertia_kg_m2")]
    assert 3.92 * error == pytest.approx(own.high - own.low)


@pytest.mark.parametrize("presliding_deg", [1.6e-4, 2e-3])
def test_the_latent_force_beside_a_friction_that_hardly_gives_is_small(presliding_deg):
    *_, noise, _, reading = RIGS["joint"]
    trials, known = logs("joint", 2.0), model("joint", inertia=1.0, presliding=presliding_deg)
    made = box(trials, known, steps=32)
    for i, trial in enumerate(trials):
        smooth = smoothed(made, Point(made.numbers(), (noise,), (1e-3,) * 3, 0.06), i)
        # Of 0.1 N m of friction.
        assert np.abs(smooth.force).max() < 0.005
        assert np.abs(smooth.position - trial.measurements[reading]).max() < 5.0 * noise


@pytest.mark.parametrize("presliding_um", [1.0, 0.2])
def test_what_slides_takes_no_short_steps_however_little_friction_gives(presliding_um):
    *_, noise, _, _ = RIGS["slide"]
    known = model("slide", inertia=1.0, presliding=presliding_um)
    logged = [Logged.of(known, i, each) for i, each in enumerate(logs("slide", 2.0))]
    prepared = PreparedTrials(known, logged, 1)
    numbers = prepared.box(known).numbers()
    right = Point(numbers, (noise,), (1e-2,) * 3, 0.06)
    # A row is 10 ms. 16 steps, each divided into 8 where readings turn, were 32 512 in all.
    rows = prepared.precise(known, right).rows
    assert min(each.lengths.min() for each in rows) > 0.99e-2 / 64
    assert sum(len(each.lengths) for each in rows) < 32_512
    white = prepared.white(prepared.box(known, steps=16), [right])
    assert np.mean(white**2) == pytest.approx(1.0, abs=0.2)


def test_a_delay_holds_for_commands_held_or_linear_where_readings_do_not_tell():
    # Of commands as smooth as these, linear ones 8 ms late are held ones that are 3 ms late.
    inertia, damping, *_ = RIGS["joint"]
    generator, trials, fine = np.random.default_rng(5), [], 2e-4
    for _ in range(3):
        time, phases = np.arange(200) / RATE_HZ, generator.uniform(0.0, 6.0, 2)
        torque = sum(
            0.2 * np.sin(6.283 * f * time + p) for f, p in zip((0.7, 1.9), phases, strict=True)
        )
        late = np.interp(np.arange(10_000) * fine + 0.5 * fine - 0.008, time, torque, left=0.0)
        spin, angle, share = 0.0, np.zeros(10_001), 0.5 * fine * damping / inertia
        for k, push in enumerate(late * fine / inertia):
            former, spin = spin, (spin * (1.0 - share) + push) / (1.0 + share)
            angle[k + 1] = angle[k] + 0.5 * fine * (former + spin)
        read = angle[:-1:50] + 4e-4 * generator.standard_normal(200)
        trials.append(Trial(time, {"torque_command": torque}, {"angle": read}))
    diagnosis = diagnose(trials, model("joint"), propose=False)
    (late,) = (each for each in diagnosis.effects if each.name == "drive_delay")
    size = late.parameters["delay_ms"]
    assert size.low < 3.0 < 8.0 < size.high < size.low + 7.0, size


def test_six_calls_lead_to_where_the_verdict_is_made():
    depths = []

    def watch(frame, event, _):
        at = frame.f_code.co_name, Path(frame.f_code.co_filename).stem
        if event == "call" and at == ("verdict", "conclusions"):
            names = [each.function for each in inspect.getouterframes(frame, context=0)]
            depths.append(names.index("refit"))

    sys.setprofile(watch)
    try:
        # As `diagnose`, without a search for effects.
        refit(logs("joint", 1.0), model("joint"))
    finally:
        sys.setprofile(None)
    assert 0 < min(depths) <= 6


@pytest.mark.campaign
def test_an_axis_that_turns_1300_times_lacks_friction_or_a_constant_torque():
    tables = {
        "torque_drive": {"gain": 1.0},
        "joint_damping": {"coefficient_n_m_s": 7.03e-5},
        "inertia": {"inertia_kg_m2": 1.2e-4},
        "joint_start": {"angle_deg": 0.0, "spin_deg_per_s": 0.0},
        "encoder": {"bandwidth_hz": 1000.0, "noise_deg": 0.012},
    }
    free = Model("axis", "axis", "joint", {n: CATALOGUE[n].parse(t) for n, t in tables.items()})
    dry = {
        "static_n_m": 0.022,
        "dynamic_n_m": 0.022,
        "stribeck_speed_deg_per_s": 5.0,
        "presliding_deg": 0.5,
    }
    time = np.arange(0.0, 20.0, 0.01)
    # One torque alone tells friction from no other inertia and damping.
    asked = {"torque_command": np.where(time < 10.0, 0.05, 0.06)}
    rubbing = Plant(free.with_effects({"joint_friction": dry}))
    angle = rubbing.simulate(Trial(time, asked), noise=True, seed=1).measurements["angle"]
    assert angle[-1] > 1300 * 2 * np.pi
    diagnosis = diagnose([Trial(time, asked, {"angle": angle})], free, propose=False)
    (effect,) = diagnosis.effects
    assert {effect.name, *effect.confused_with} & {"joint_friction", "constant_torque"}
    size = effect.parameters.get("dynamic_n_m") or effect.parameters["torque_n_m"]
    assert abs(size.value) == pytest.approx(0.022, rel=0.02)
    assert inertia_of(diagnosis, "joint") == pytest.approx(1.2e-4 / 0.01, rel=0.02)


EXAMPLES = Path(__file__).parents[3] / "docs" / "examples"


@cache
def measured(name, folder):
    """The diagnosis of an example of a measured rig, from its logs as they came."""
    script = EXAMPLES / f"{name}.py"
    subprocess.run([sys.executable, script, folder], check=True, stdout=subprocess.DEVNULL)
    return diagnose(read_dataset(folder), propose=False)


@pytest.mark.campaign
def test_a_geared_servo_that_swings_a_weight_lacks_it_and_friction_by_load(tmp_path):
    """0.48 N m at 90 deg; within the swing a spring is much like a weight: they are rivals."""
    diagnosis = measured("servo_pendulum", tmp_path)
    named = {name: each for each in diagnosis.effects for name in (each.name, *each.confused_with)}
    assert diagnosis.verdict == "effect", diagnosis.sentence
    assert {"joint_weight", "joint_load_friction"} <= set(named)
    (angle,) = diagnosis.gap.values()
    assert angle.after < 0.1 * angle.before


@pytest.mark.campaign
def test_a_servo_whose_voltage_is_rebuilt_from_a_guess_decides_nothing(tmp_path):
    diagnosis = measured("servo_wheel", tmp_path)
    assert diagnosis.verdict == "undecidable" and not diagnosis.effects
    assert "too far from the model" in diagnosis.sentence
    assert diagnosis.model == diagnosis.given


@pytest.mark.campaign
def test_an_inertia_far_from_the_data_sheet_is_said_and_what_to_write_helps():
    trials = logs("joint", 2.0)
    diagnosis = diagnose(trials, model("joint", inertia=5.0, presliding=NEAR["joint"]))
    assert diagnosis.verdict == "undecidable", diagnosis.sentence
    said = re.search(r"inertia\.inertia_kg_m2 ([\d.]+) kg", diagnosis.sentence)
    assert said and diagnosis.model == diagnosis.given
    # As the sentence says: the fitted value into the model.
    share = float(said[1]) / RIGS["joint"][0]
    again = diagnose(trials, model("joint", inertia=share, presliding=NEAR["joint"]))
    assert again.verdict in ("agrees", "parameters") and not again.effects, again.sentence


def swing(trial, noise_deg, seed):
    """A trial of a weight on an arm, and its model without the weight."""
    known = model("joint", inertia=1.0).replace({"encoder.noise_deg": noise_deg})
    plant = Plant(known.with_effects({"joint_weight": {"moment_n_m": 0.4, "offset_deg": 0.0}}))
    read = plant.simulate(trial, seed=seed).measurements["angle"]
    return replace(trial, measurements={"angle": read}), known


def swings(tones, size, noise_deg):
    """Two trials under sums of sines, and the model without the weight."""
    time, phases = np.arange(400) / RATE_HZ, np.random.default_rng(0).uniform(0.0, 6.0, (2, 3, 1))
    waves = np.sin(6.283 * np.outer(tones, time) + phases) - np.sin(phases)
    pulls = [Trial(time, {"torque_command": size * wave.sum(axis=0)}) for wave in waves]
    trials, models = zip(*(swing(pull, noise_deg, k) for k, pull in enumerate(pulls)), strict=True)
    return trials, models[0]


def test_the_proposed_trial_tells_a_weight_from_a_spring_that_small_swings_do_not():
    trials, known = swings((2.1, 3.3, 5.0), 0.06, 0.3)
    first = diagnose(trials, known)
    following, rivals = first.next_experiment, {"joint_weight", "joint_spring"}
    assert {first.effects[0].name, *first.effects[0].confused_with} == rivals
    assert set(following.separates) == rivals and following.expected_odds > 1e5
    within = np.concatenate([each.commands["torque_command"] for each in trials])
    proposed = following.trial.commands["torque_command"]
    assert within.min() <= proposed.min() and proposed.max() <= within.max()
    assert proposed[0] == proposed[-1] == 0.0 and following.minutes < 1.0
    (decided,) = diagnose([*trials, swing(following.trial, 0.3, 9)[0]], known).effects
    assert (decided.name, decided.confused_with) == ("joint_weight", ())
    assert decided.parameters["moment_n_m"].value == pytest.approx(0.4, rel=0.01)


HIDDEN = {
    "drive_dead_band": (
        lambda size: lambda force, x: force - min(max(force, -size), size),
        {"slide": {"width_n_or_n_m": 3.0}},
    ),
    "joint_cogging": (
        lambda size, often, phase: lambda force, x: force + size * cos(often * x + radians(phase)),
        {"joint": {"amplitude_n_m": 0.08, "periods_per_turn": 12.0, "phase_deg": 40.0}},
    ),
}
"""What a drive hides: its law by its sizes, and these by rig."""


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "plant"), [(name, plant) for name in HIDDEN for plant in HIDDEN[name][1]]
)
def test_what_a_drive_does_is_named_with_its_size(plant, name):
    law, truth = HIDDEN[name][0], HIDDEN[name][1][plant]
    diagnosis = diagnosed(plant, NEAR[plant], drive=law(*truth.values()))
    assert [each.name for each in diagnosis.effects] == [name], diagnosis.sentence
    for path, value in truth.items():
        size = diagnosis.effects[0].parameters[path]
        assert size.low <= value <= size.high, (path, size)


@pytest.mark.campaign
def test_where_no_trial_within_the_commands_of_the_logs_decides_that_is_said():
    diagnosis = diagnose(*swings((0.8, 1.4, 2.0), 0.003, 0.1))
    assert diagnosis.effects[0].confused_with and diagnosis.next_experiment is None
    assert "joint spring apart; larger commands, another load or" in diagnosis.warnings[0]


@pytest.mark.usefixtures("forget_user_effects")
def test_a_torque_that_no_effect_has_is_written_as_a_law_and_drafted_as_a_user_effect(tmp_path):
    trials = logs("joint", 2.0, friction=(0.0, 0.0, 0.0), bump=0.2)
    first = diagnose(trials, known := model("joint", inertia=1.0))
    assert first.verdict == "unknown" and "goes with angle" in first.sentence, first.sentence
    # The law is the bump, where the joint was, and the model with it closes the gap.
    bump = 0.2 * np.exp(-50.0 * (np.radians(first.law.at) - 0.2) ** 2)
    assert first.law.law == pytest.approx(bump, abs=0.04) and not first.next_experiment
    assert "residual_torque_of_angle" in first.model.effects and not first.warnings
    (gap,) = first.gap.values()
    assert gap.held_out and gap.after < 0.25 * gap.parameters
    (tmp_path / "proposed_effect.py").write_text(first.draft)
    load_effects(tmp_path / "proposed_effect.py")
    (effect,) = (again := diagnose(trials, known, propose=False)).effects
    assert effect.parameters["share_percent"].value == pytest.approx(100.0, abs=20.0)
    assert again.gap["angle_deg"].after < 0.2 * gap.parameters


@pytest.mark.parametrize(
    ("plant", "at", "stiffness"),
    [("joint", 0.3, 2.0), pytest.param("slide", 0.03, 2e3, marks=pytest.mark.campaign)],
)
def test_a_bumper_is_no_effect_that_imitates_it_but_a_law_that_is_written(plant, at, stiffness):
    def pushed(force, position):
        return force - stiffness * max(position - at, 0.0)

    trials = logs(plant, 2.0, friction=(0.0, 0.0, 0.0), drive=pushed)
    diagnosis = diagnose(trials, model(plant, inertia=1.0), propose=False)
    assert diagnosis.verdict == "unknown" and not diagnosis.effects, diagnosis.sentence
    law = diagnosis.law
    bumper = -stiffness * np.maximum(law.at / {"joint": 180.0 / np.pi, "slide": 1e3}[plant] - at, 0)
    # An offset of the drive makes up for a constant, a straight line rounds the corner.
    free, most = law.law - law.law[:5].mean(), np.ptp(bumper)
    assert free == pytest.approx(bumper, abs=0.2 * most)
    assert law.law[:5] == pytest.approx(law.law[:5].mean(), abs=0.02 * most)
    assert (law.high - law.low).max() < 0.1 * most
    (gap,) = diagnosis.gap.values()
    assert gap.held_out and gap.after < 0.1 * gap.parameters
    assert any(name.startswith("residual_") for name in diagnosis.model.effects)


def test_a_brake_on_a_part_of_the_way_is_a_damping_over_the_position_that_is_drafted():
    def brake(position):
        return 0.2 * np.exp(-20.0 * (position - 0.2) ** 2)

    trials = logs("joint", 2.0, friction=(0.0, 0.0, 0.0), brake=brake)
    first = diagnose(trials, model("joint", inertia=1.0), propose=False)
    assert first.verdict == "unknown" and first.law.quantity == "damping of the joint (N m s)"
    assert "It is a damping that goes with angle" in first.sentence
    # What it damps everywhere is the model's own damping.
    truth, (gap,) = brake(np.radians(first.law.at)), first.gap.values()
    assert first.law.law - first.law.law.min() == pytest.approx(truth, abs=0.05)
    assert gap.held_out and gap.after < 0.5 * gap.parameters
    assert "residual_damping_of_angle" in first.model.effects
    assert "-spin * p.share * interp(angle, AT, LAW)" in first.draft


def test_of_one_long_log_stretches_are_left_out():
    def bumped(force, position):
        return force - 2.0 * max(position - 0.3, 0.0)

    trials = logs("joint", 6.0, friction=(0.0, 0.0, 0.0), drive=bumped)[:1]
    diagnosis = diagnose(trials, model("joint"), propose=False)
    (gap,) = diagnosis.gap.values()
    assert gap.held_out and "stretches that it was not fitted to" in diagnosis.sentence
    assert gap.after < 0.1 * gap.parameters


@pytest.mark.parametrize(
    ("force", "hertz"),
    [
        (lambda t: np.sin(6.283 * 7.3 * t), 7.3),
        # The motion's own frequency is no line of its own.
        (lambda t: np.sin(6.283 * t + 0.3), None),
        (lambda t: np.random.default_rng(3).standard_normal(len(t)), None),
    ],
)
def test_a_latent_force_oscillates_at_a_frequency_or_does_not(force, hertz):
    t, trials = np.arange(500) / RATE_HZ, []
    for phase in (0.0, 1.0, 2.5):
        x, speed = np.sin(6.283 * t + phase), 6.283 * np.cos(6.283 * t + phase)
        trials.append(Smoothed(t, force(t), 0.0 * t, x, speed, 0.0 * t))
    assert latent_line(trials) == (hertz and pytest.approx((hertz, 1.0), abs=0.1))


@pytest.mark.parametrize("often", [2.0, 7.3, 40.0])
def test_a_force_over_the_position_has_its_period_whatever_goes_with_the_place(often):
    t = np.arange(2000) / RATE_HZ
    x = 0.7 * np.sin(6.283 * 0.4 * t) + 0.3 * np.sin(6.283 * t)
    force = 5.0 * np.sin(1.5 * x) + np.cos(6.283 * often * x + 0.3)
    trial = Smoothed(t, force, 0.0 * t, x, 0.0 * t, 0.0 * t)
    assert line_over_position([trial]) == pytest.approx(often, abs=0.25 / np.ptp(x))


@pytest.mark.parametrize(("late", "is_named"), [(9e-7, False), (2e-6, True)])
def test_a_delay_that_no_model_may_have_is_none(late, is_named):
    """`drive_delay` begins at 1 us. A delay of 0.6 us, fitted and sure, ended in an error."""
    fitted = SimpleNamespace(
        point=SimpleNamespace(delay=late),
        deviations={"delay": 1e-8},
        coordinates=[SimpleNamespace(name="delay")],
        value=100.0,
    )
    proposal = SimpleNamespace(
        last=SimpleNamespace(fit=fitted, price_of=lambda numbers: 5.0),
        candidates=["drive_delay"],
        selection=SimpleNamespace(trials=SimpleNamespace(span=0.01, stride=1, block=1)),
        predictions=SimpleNamespace(misfit=lambda each: 1.0),
        _prompt=50.0,
    )
    assert Proposal.delay_gain.func(proposal) == (45.0 if is_named else 0.0)
