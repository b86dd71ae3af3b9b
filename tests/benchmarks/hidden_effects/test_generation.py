import ast
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects import physics
from benchmarks.hidden_effects.evaluation import scoring
from benchmarks.hidden_effects.evaluation.verdicts import compare
from benchmarks.hidden_effects.generation import files
from benchmarks.hidden_effects.generation.cases import BLOCKS, Block, draw_case
from benchmarks.hidden_effects.generation.effect_size import simulate_variants
from benchmarks.hidden_effects.generation.effects import ALL, KINDS
from benchmarks.hidden_effects.generation.excitation import EXCITATIONS, draw_trial
from benchmarks.hidden_effects.generation.groups import GROUPS, expected, group
from benchmarks.hidden_effects.physics.rig import NOMINAL, SENSORS, SIGNALS, noise_levels
from benchmarks.hidden_effects.physics.simulation import RATE, Commands
from pma_gym.data.trial import Trial
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

TINY = {"trials": 3, "seconds": 3.0}
HIDDEN = Block("single", ("drive_dead_zone",), **TINY)
NOTHING = Block("nothing", **TINY)

TYPICAL = {
    "nonlinear_stiffness": {"curvature": 1.0, "growth": 2.0},
    "passive_stretch": {"factor": 1.0},
    "load_dependent_damping": {"linear": 6.0, "quadratic": -6.0},
    "regulator_asymmetry": {"excess": 0.4},
    "regulator_rate_limit": {"limit_kpa_per_s": 600.0},
    "regulator_delay": {"delay_ms": 20.0},
    "regulator_deadband": {"width_kpa": 3.0},
    "hysteresis": {"force_n": 25.0, "distance_mm": 1.5},
    "creep": {"stiffness_n_per_mm": 0.8, "time_constant_s": 2.0, "spread": 1.3},
    "slow_creep": {"stiffness_n_per_mm": 0.8, "time_constant_s": 40.0, "spread": 1.3},
    "coulomb_friction": {
        "dynamic_n": 6.0,
        "breakaway": 1.2,
        "stribeck_speed_mm_per_s": 5.0,
        "presliding_um": 15.0,
    },
    "bearing_friction": {"force_n": 5.0, "presliding_um": 60.0},
    "filling": {"exponent": 1.2},
    "warm_up": {"force_at_200_kpa_n": 23.0, "half_life": 0.6},
    "cable_slack": {"slack_mm": 1.0},
    "drive_dead_zone": {"width_n": 12.0, "slope": 2.0},
    "drive_saturation": {"most_n": 500.0, "cut_n": 50.0},
    "drive_lag": {"time_constant_ms": 10.0},
    "drive_delay": {"delay_ms": 10.0},
    "torque_ripple": {"amplitude_percent": 0.8, "periods": 12.0, "phase_deg": 40.0},
    "current_imbalance": {"amplitude_percent": 2.7, "periods": 6.0, "phase_deg": 20.0},
    "potentiometer_backlash": {"width_deg": 2.0},
    "lvdt_lag": {"longer_ms": 20.0},
    "potentiometer_lag": {"longer_ms": 20.0},
    "load_cell_lag": {"longer_ms": 20.0},
    "pressure_transducer_lag": {"longer_ms": 20.0},
    "sensor_quantisation": {"signal": 0.0, "daq_steps": 4.0},
}

SHAPES = {
    "hysteresis": {"distance_mm": 1.5},
    "slow_creep": {"time_constant_s": 40.0},
    "coulomb_friction": {"static_n": 7.2, "stribeck_speed_mm_per_s": 5.0, "presliding_um": 15.0},
    "bearing_friction": {"presliding_deg": 0.14},
    "drive_lag": {"share": 1.0},
    "drive_delay": {"share": 1.0},
    "regulator_delay": {"share": 1.0},
    "torque_ripple": {"periods": 12.0, "phase_deg": 40.0},
    "current_imbalance": {"periods": 6.0, "phase_deg": 20.0},
    # exp(-P / 100 kPa) and (P / 200 kPa)^-3 meet at 200 kPa.
    "warm_up": {"force_n": 170.0, "fade_kpa": 100.0, "repeats": 0.87, "repeat": 0.0},
    "nonlinear_stiffness": {"linear": 0.5, "quadratic": 0.33},
}
"""What the catalogue's law takes besides `expected`."""


@pytest.fixture(scope="module")
def commands():
    g = np.random.default_rng(5)
    drawn = [draw_trial(g, name, 4.0, False, False) for name in EXCITATIONS]
    drawn.append(draw_trial(g, "triangles", 4.0, True, False))
    drawn.append(draw_trial(g, "reversals", 4.0, False, True))
    motor, regulator = zip(*drawn, strict=True)
    return Commands(np.array(motor), np.array(regulator), np.zeros(len(drawn)))


@pytest.fixture(scope="module")
def ours(commands):
    """Readings with nothing hidden, and with each effect at its typical size."""
    variants = [(NOMINAL, {}), *((NOMINAL, {name: TYPICAL[name]}) for name in KINDS)]
    readings = simulate_variants(commands, variants)
    return readings[0], dict(zip(KINDS, readings[1:], strict=True))


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    path = tmp_path_factory.mktemp("lab") / "model.toml"
    path.write_text(files.lab_model(), "utf-8")
    return load_model(path)


def plants_readings(model, commands):
    plant, out = Plant(model), []
    time = np.arange(commands.motor.shape[1]) / RATE
    for motor, regulator in zip(commands.motor, commands.regulator, strict=True):
        trial = Trial(
            time=time,
            commands={"motor_voltage": motor, "regulator_voltage": regulator},
            measurements={},
        )
        measured = plant.simulate(trial, noise=False).measurements
        out.append(np.stack([measured[name] for name in SIGNALS], axis=1))
    return np.array(out)


@pytest.fixture(scope="module")
def theirs(lab, commands):
    return plants_readings(lab, commands)


def test_the_lab_believes_in_no_friction(lab):
    assert "coulomb_friction" not in lab.parameters
    assert lab.parameters["cable"].slack == 0.0


@pytest.mark.campaign
def test_agrees_with_the_plant_with_nothing_hidden(ours, theirs):
    difference = (ours[0] - theirs) / noise_levels(np.ones(4))
    rms = np.sqrt(np.mean(difference**2, axis=(0, 1)))
    # A cable that snaps tight from slack rings; there steps of two integrators differ most.
    assert np.all(rms < 0.1)
    tight = difference[ours[0][:, 0, 2] > 1.0]
    assert np.sqrt(np.mean(tight**2)) < 0.05


def model_with(lab, name):
    values = expected(name, TYPICAL[name]) | SHAPES.get(name, {})
    if name == "cable_slack":
        return lab.replace({"cable.slack_mm": values["slack_mm"]})
    sensor = name.removesuffix("_lag")
    if sensor in SENSORS:
        return lab.replace({f"{sensor}.bandwidth_hz": values["bandwidth_hz"]})
    if name not in CATALOGUE:
        return None
    file_keys = CATALOGUE[name].names_in_files()
    defaults = {
        "resting_length_mm": 250.0,
        "resting_diameter_mm": 20.0,
        "turns": 2.085,
        "force_slope_n_per_kpa": 2.91,
        "force_intercept_n": 44.6,
        "stiffness_n_per_mm": 20.0,
    }
    given = {**defaults, **values}
    return lab.with_effects({name: {d: given[d] for d in file_keys if d in given}})


@pytest.mark.parametrize("name", KINDS)
def test_does_what_the_catalogue_says(name, lab, commands, ours, theirs):
    model = model_with(lab, name)
    if model is None:
        pytest.skip("the catalogue has no such law")
    noise = noise_levels(np.ones(4))
    change = ((ours[1][name] - ours[0]) / noise).ravel()
    wanted = ((plants_readings(model, commands) - theirs) / noise).ravel()
    assert np.sqrt(np.mean(change**2)) > 0.3, "the excitations do not excite it"
    assert change @ wanted / np.linalg.norm(change) / np.linalg.norm(wanted) > 0.8
    assert 0.4 < np.linalg.norm(change) / np.linalg.norm(wanted) < 2.5


def test_an_effect_of_size_0_is_absent(commands):
    few = Commands(commands.motor[1:3, :200], commands.regulator[1:3, :200], commands.order[1:3])
    absent = {name: ALL[name].at(TYPICAL[name], 0.0) for name in KINDS}
    plain, with_all = simulate_variants(few, [(NOMINAL, {}), (NOMINAL, absent)])
    assert np.abs((with_all - plain) / noise_levels(np.ones(4))).max() < 1e-6


def test_a_leak_lowers_the_pressure_as_far_as_the_regulator_lets_it():
    """At rest (asked - p) / tau = k (p + 1 atm), once the leak is open; before, nothing leaks."""
    rows = int(2.5 * RATE)
    still = Commands(np.full((1, rows), 1.0), np.full((1, rows), 4.0), np.zeros(1))
    leak = {"leakage": {"rate_per_s": 0.2, "opening_s": 0.4}}
    tight, leaking = simulate_variants(still, [(NOMINAL, {}), (NOMINAL, leak)])
    tau = NOMINAL["regulator_time"]
    asked = tight[0, -1, 3]
    drop = tau * 0.2 * (asked + 101325.0) / (1.0 + tau * 0.2)
    assert leaking[0, 0, 3] == pytest.approx(tight[0, 0, 3], abs=100.0)
    assert asked - leaking[0, -1, 3] == pytest.approx(drop, rel=5e-3)


def test_the_simulation_imports_nothing_of_the_package():
    folder = Path(physics.__file__).parent
    generation = folder.parent / "generation"
    modules = ("cases", "effect_size", "effects", "excitation")
    for path in [*folder.glob("*.py"), *(generation / f"{name}.py" for name in modules)]:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                inside = name.startswith("benchmarks.hidden_effects.")
                assert inside or name.split(".")[0] in {*sys.stdlib_module_names, "numpy", "scipy"}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Three tiny cases; a kill interrupted the first, and it was written again."""
    folder = tmp_path_factory.mktemp("drawn")
    written, real = [], files._csv

    def killed(case, i):
        written.append(i)
        if len(written) == 2:
            raise KeyboardInterrupt
        return real(case, i)

    files._csv = killed
    try:
        with pytest.raises(KeyboardInterrupt):
            files.write_case(HIDDEN.draw(3, 1), folder, 1)
    finally:
        files._csv = real
    assert not list((folder / "cases").iterdir())
    for number, block in enumerate((HIDDEN, NOTHING, HIDDEN), 1):
        files.write_case(block.draw(3, number), folder, number)
    return folder


def test_a_case_has_its_files(drawn):
    cases = list((drawn / "cases").iterdir())
    assert sorted(p.name for p in cases) == ["case_0001", "case_0002", "case_0003"]
    for case in cases:
        names = {path.name for path in case.iterdir()}
        assert names == {"dataset.toml", "model.toml", *(files.trial_name(i) for i in range(3))}


def test_the_same_seed_gives_the_same_bits(drawn, tmp_path):
    files.write_case(HIDDEN.draw(3, 1), tmp_path, 1)
    for path in (tmp_path / "cases").rglob("*.*"):
        assert path.read_bytes() == (drawn / path.relative_to(tmp_path)).read_bytes()


def test_the_truth_is_not_in_the_case(drawn):
    for path in (drawn / "cases").rglob("*.toml"):
        text = path.read_text("utf-8")
        assert not any(name in text for name in ALL)
    truth = json.loads((drawn / "truth" / "case_0001.json").read_text("utf-8"))
    assert truth["effects"][0]["name"] == "drive_dead_zone"
    assert truth["effects"][0]["r"] == pytest.approx(truth["effects"][0]["target"], rel=0.1)


def test_a_case_is_a_data_set(drawn):
    dataset = pytest.importorskip("pma_gym.data.datasets.dataset")
    data = dataset.read_dataset(drawn / "cases" / "case_0002")
    assert len(data) == 3
    last = data.trials[-1]
    twin = next(trial for trial in data.trials if trial.name == last.repeat_of)
    for name, values in last.trial.commands.items():
        assert np.array_equal(values, twin.trial.commands[name])
    noise = last.trial.measurements["load"] - twin.trial.measurements["load"]
    assert 0.3 < np.std(noise) / np.sqrt(2.0) < 1.2
    assert last.trial.measurements["rotation"][0] == 0.0


def test_trials_stay_within_what_the_rig_bears():
    for readings in draw_case(11, 0, "parameters", seconds=4.0).readings:
        assert -9.0 < readings[:, 0].min() and readings[:, 0].max() < 70.0
        assert readings[:, 2].max() < 1150.0 and readings[:, 3].max() < 570.0


@pytest.mark.campaign
def test_slow_effects_hide_under_a_drift():
    block = replace(BLOCKS["slow_drift"], **TINY)
    truths = [block.draw(11, number).truth for number in (1, 2, 3)]
    assert [t["effects"][0]["name"] for t in truths] == ["creep", "leakage", "warm_up"]
    assert all(t["readout_noise"]["kind"] == "drift" and not t["weak"] for t in truths)


def test_groups_are_small_and_known():
    delays = {f"{sensor}_delay" for sensor in SENSORS}
    for names in GROUPS:
        assert len(names) >= 2 and len(names - delays) <= 3 and names <= {*KINDS, *delays}
        assert all(name.replace("_delay", "_lag") in names for name in names & delays)
    assert group("filling") == {"filling"}


def answer(verdict, *names, confused=()):
    effects = [
        {"name": name, "confused_with": list(confused), "p_value": 0.001, "parameters": {}}
        for name in names
    ]
    gap = {"before": 1.0, "after": 0.15, "floor": 0.1, "held_out": True, "closed": 0.9444}
    return {"verdict": verdict, "effects": effects, "parameters": {}, "gap": {"load_n": gap}}


def test_answers_are_counted(drawn):
    said = answer("effect", "cable_slack")
    truths = [json.loads(p.read_text("utf-8")) for p in sorted((drawn / "truth").iterdir())]
    document = scoring.count([compare(truth, said) for truth in truths])
    single = document["blocks"]["single"]["rates"]
    assert single["named right"]["hits"] == 0 and single["named right"]["n"] == 2
    assert single["right or in its group"]["hits"] == 2
    assert single["confidently wrong"]["hits"] == 0
    assert document["blocks"]["nothing"]["rates"]["false alarm"]["rate"] == 1.0
    assert document["blocks"]["single"]["gap_closed"]["median"]["value"] == pytest.approx(0.9444)
    assert [each["said"] for each in document["blocks"]["single"]["misses"]] == ["cable_slack"] * 2
    assert not document["blocks"]["single"]["unanswered"]


def test_an_answer_is_compared_with_its_truth():
    def outcome(block, hidden, *args, **more):
        effects = [{"name": name, "parameters": TYPICAL[name]} for name in hidden]
        truth = {"block": block, "effects": effects, "base_factors": {"mass": 1.2}}
        return scoring.compare(truth, answer(*args, **more))

    assert outcome("single", ["creep"], "effect", "creep").right
    assert outcome("single", ["creep"], "effect", "filling").wrong
    # Groups were fixed before; a doubt that an answer has is counted by itself.
    doubting = outcome("single", ["creep"], "effect", "filling", confused=["creep"])
    assert doubting.wrong and doubting.beside and not doubting.near
    akin = outcome("single", ["creep"], "effect", "warm_up")
    assert akin.near and not akin.wrong and not akin.right
    assert outcome("single", ["creep"], "effect", "creep", "filling").spurious
    assert not outcome("single", ["creep"], "undecidable").wrong
    assert outcome("pair", ["creep", "filling"], "effect", "filling", "creep").hits == 2
    assert outcome("parameters", [], "parameters").parameters is False


def test_a_parameter_that_was_missed_is_told_with_what_was_named_instead():
    factors = {"mass": 1.2, "radius": 0.8}
    truth = {"block": "parameters", "effects": [], "base_factors": factors, "number": 3}
    moved = {
        path: {"significant": path != "drive.gain_n_per_v"}
        for path in ("rotor.radius_mm", "cable.stiffness_n_per_mm", "drive.gain_n_per_v")
    }
    missed = scoring.compare(truth, answer("parameters") | {"parameters": moved})
    assert missed.parameters is False and missed.missing == ("mass",)
    assert missed.beyond == ("cable.stiffness_n_per_mm",)
    block = scoring.count([missed])["blocks"]["parameters"]
    (miss,) = block["misses"]
    assert miss["said"].endswith("cable.stiffness_n_per_mm; without mass")


def test_what_comes_in_one_size_is_in_no_range_of_sizes():
    def outcome(name):
        effects = [{"name": name, "parameters": TYPICAL[name], "r": 3.0}]
        truth = {"block": "single", "effects": effects, "base_factors": {}}
        return scoring.compare(truth, answer("effect", name))

    (row,) = scoring.count([outcome("sensor_quantisation"), outcome("creep")])["blocks"]["single"][
        "by_size"
    ]
    assert row["named"]["n"] == 1
