"""Cases of block `rigs`: same seed, same bits; sizes; what is read; how answers are judged."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden_effects.evaluation.scoring import count
from benchmarks.hidden_effects.evaluation.summary import report
from benchmarks.hidden_effects.evaluation.verdicts import compare
from benchmarks.hidden_effects.generation.cases import BLOCKS
from benchmarks.hidden_effects.generation.files import write_case
from benchmarks.hidden_effects.rigs import drawing, effect_size, files
from benchmarks.hidden_effects.rigs.drawing import KNOWN, OFFERS, catalogue_name, group
from benchmarks.hidden_effects.rigs.driven_campaign import draw_driven
from benchmarks.hidden_effects.rigs.effect_size import expected
from benchmarks.hidden_effects.rigs.files import GERMAN, METRES, OURS
from benchmarks.hidden_effects.rigs.laws import CoulombFriction, Gravity, PressureFriction
from benchmarks.hidden_effects.rigs.rig import draw_joint, draw_slide
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.effects import CATALOGUE
from tests.benchmarks.hidden_effects.cheap_diagnosis import document

CHEAP = (1, 1)
"""Seed and number of a case that is drawn in seconds by the folder's own simulator."""


@pytest.fixture(scope="module")
def case():
    return BLOCKS["rigs"].draw(*CHEAP)


def test_the_same_seed_and_number_give_the_same_bits(case):
    again = BLOCKS["rigs"].draw(*CHEAP)
    assert again.files == case.files
    assert json.dumps(again.truth) == json.dumps(case.truth)


def test_a_diagnosis_reads_what_was_drawn_and_no_truth(case, tmp_path):
    write_case(case, tmp_path, 1)
    folder = tmp_path / "cases" / "case_0001"
    dataset = read_dataset(folder)
    assert len(dataset.trials) == len(case.truth["seconds"])
    assert {"model.toml", "dataset.toml"} < {each.name for each in folder.iterdir()}
    assert not any(case.truth["effects"][0]["name"] in each for each in case.files.values())
    assert json.loads((tmp_path / "truth" / "case_0001.json").read_text("utf-8"))["seed"] == 1


def test_an_effect_has_the_size_that_was_drawn(case):
    effect = case.truth["effects"][0]
    assert 0.45 <= effect["r"] <= 1.5 * drawing.STRONG[1]


def test_of_600_cases_200_hide_one_effect_100_two_and_200_none():
    turns = [drawing.turn_of(number) for number in range(1, 601)]
    kinds = Counter(kind for _, kind, _ in turns)
    # Three rigs take turns in six kinds: 600 ends within a round of 18.
    assert kinds["one effect"] == kinds["nothing"] == 201
    assert kinds["two effects"] == kinds["outside"] == 99
    halves = Counter(simulator for _, _, simulator in turns[: 12 * len(KNOWN)])
    assert halves["own"] == halves["MuJoCo"]
    assert len(set(turns)) == 4 * len(KNOWN) * 2


def test_a_pilot_is_the_beginning_of_its_file():
    """Each effect's size is set on the bits that the file then has."""
    rng = np.random.default_rng(5)
    campaign = draw_driven(rng, "slide", "own", (5, 1))
    short, long = (campaign.run((), 0, seconds)[1] for seconds in (2.0, 3.0))
    assert np.array_equal(long[: len(short)], short)


@pytest.mark.parametrize("kind", ["slide", "joint"])
@pytest.mark.parametrize("simulator", ["own", "MuJoCo"])
def test_no_effect_has_no_size(kind, simulator):
    """An integrator's error would be an effect that nobody hid: encoders of 50 nm show it."""
    if simulator == "MuJoCo":
        pytest.importorskip("mujoco")
    for seed in (2, 3):
        campaign = draw_driven(np.random.default_rng(seed), kind, simulator, (5, seed))
        plain = effect_size.change(campaign.rig, campaign.run((), 0, 4.0)[0])
        assert effect_size.size(plain, campaign.sensor.rms) < 1e-3


def test_a_lab_without_rest_or_repeat_states_its_tolerance():
    campaign = replace(draw_driven(np.random.default_rng(2), "slide", "own", (5, 2)), repeats={})
    campaign = replace(campaign, bandwidth=campaign.rig.frequency)
    campaign = replace(campaign, references=[campaign.references[0]])
    texts = campaign.texts([])
    assert "tolerance" not in texts["dataset.toml"]
    # The drive is off while it rests, and every reading is of one place.
    rows = [line.split(",") for line in texts["run_01.csv"].splitlines()[1:100]]
    assert {float(row[1]) for row in rows} == {0.0}
    pulled = campaign.texts([Gravity(0.1 * campaign.rig.peak_force, 0.5)])
    stated = float(pulled["dataset.toml"].split("contraction_mm = ")[1].split()[0])
    assert stated == pytest.approx(1e3 * campaign.sensor.rms, rel=1e-5)


@pytest.fixture(scope="module")
def slide_model():
    """Text of the model of a drawn slide."""
    return draw_driven(np.random.default_rng(2), "slide", "own", (5, 2)).texts([])["model.toml"]


@pytest.mark.parametrize("names", [OURS, METRES, GERMAN])
def test_a_lab_s_own_names_and_units_are_read_as_ours(names, slide_model, tmp_path):
    force, position = np.array([0.0, 1.25, -2.5]), np.array([0.00045, 12.3456, -7.0])
    tables = [{"load_command_n": (force, 4), "contraction_mm": (position, 5)}]
    for name, text in files.folder(50.0, tables, {}, slide_model, {}, names).items():
        (tmp_path / name).write_text(text, "utf-8")
    trial = read_dataset(tmp_path).trials[0].trial
    assert trial.time == pytest.approx([0.0, 0.02, 0.04])
    assert trial.commands["load_command"] == pytest.approx(force, abs=1e-4)
    assert trial.measurements["contraction"] == pytest.approx(1e-3 * position, abs=1e-8)


@pytest.mark.parametrize("draw", [lambda rng: draw_slide(rng, True), draw_joint])
def test_rigs_are_of_all_sizes_and_keep_their_limits(draw):
    rigs = [draw(np.random.default_rng(seed)) for seed in range(300)]
    travels = [rig.travel for rig in rigs]
    assert max(travels) > 20 * min(travels)
    assert max(rig.inertia for rig in rigs) > 1000 * min(rig.inertia for rig in rigs)
    assert {rig.rate for rig in rigs} >= {100.0, 500.0, 2000.0}
    for rig in rigs:
        assert rig.rate >= 30.0 * rig.frequency
        assert rig.peak_speed * 2.0 * np.pi * rig.frequency <= (
            15.1 if rig.kind == "slide" else 401
        )


def test_the_step_of_an_encoder_may_be_named_beside_what_is_hidden():
    friction = ("coulomb_friction", 2.0)
    both = answer("effect", 0.01, ("sensor_quantisation", {}), ("coulomb_friction", {}))
    coarse = {"true_besides": ["sensor_quantisation"]}
    named = compare(truth("one effect", friction) | coarse, both)
    assert named.right and not named.spurious
    plain = answer("effect", 0.01, ("sensor_quantisation", {}))
    assert not compare(truth("nothing") | coarse, plain).detected
    assert compare(truth("nothing"), plain).detected


def test_what_is_hidden_has_its_size_in_the_unit_of_the_catalogue():
    for kind, names in KNOWN.items():
        for name in (catalogue_name(kind, each) for each in names):
            ((key, size),) = expected(kind, name, {"size": 3.0, "slope": 1.0}).items()
            quantity = CATALOGUE[name].quantities[CATALOGUE[name].names_in_files()[key]]
            assert abs(size) == pytest.approx(quantity.from_si(3.0))


def test_frictions_of_a_contact_add_up():
    """At no pressure the hidden friction of a seal is its size; the catalogue's there is none."""
    contact, seal = {"size": 0.11}, {"size": 0.065, "slope": 2e-6}
    beside = {"contact_friction": contact, "pressure_friction": seal}
    both = expected("imposed", "contact_friction", contact, beside)
    assert both == {"force_n": pytest.approx(0.175)}
    slope = expected("imposed", "pressure_friction", seal, beside)["slope_n_per_kpa"]
    kilopascals = 300.0
    total = both["force_n"] + slope * kilopascals
    hidden = CoulombFriction(**contact).kinetic(0.0, 0.1, 3e5)
    hidden += PressureFriction(**seal).kinetic(0.0, 0.1, 3e5)
    assert total == pytest.approx(hidden)


def test_what_cannot_be_hidden_together_is_of_one_group():
    assert all(name in OFFERS for names in KNOWN.values() for name in names)
    assert group("drive_lag")[0] == "drive_lag" and "drive_delay" in group("drive_lag")
    assert group("spring") == ("spring",)


def truth(kind, *effects, noise=0.01):
    hidden = [
        {"name": name, "group": group(name), "parameters": {"size": size}, "r": 1.0}
        for name, size in effects
    ]
    return {
        "block": "rigs",
        "rig": {"kind": "slide"},
        "kind": kind,
        "effects": hidden,
        "base_factors": {},
        "noise": {"contraction_mm": noise},
    }


def answer(verdict, after, *effects):
    gap = {"before": 1.0, "after": after, "floor": 0.01, "closed": 0.9, "held_out": True}
    return document(verdict, *effects) | {"gap": {"contraction_mm": gap}}


def value(number, low, high):
    return {"value": number, "low": low, "high": high}


def test_answers_are_judged_by_what_their_case_hides():
    friction = ("coulomb_friction", 2.0)
    named = ("coulomb_friction", {"dynamic_n": value(2.1, 1.9, 2.3)})
    pairs = [
        (truth("one effect", friction), answer("effect", 0.01, named)),
        (truth("one effect", ("drive_delay", 0.01)), answer("effect", 0.01, ("drive_lag", {}))),
        (truth("one effect", friction), answer("effect", 0.01, ("drive_lag", {}))),
        (truth("one effect", friction), answer("parameters", 0.04)),
        (truth("one effect", friction), answer("parameters", 0.02)),
        (truth("two effects", friction, ("drive_lag", 0.01)), answer("effect", 0.01, named)),
        (truth("nothing"), answer("unknown", 0.01)),
        (truth("nothing"), answer("parameters", 0.01)),
        (truth("outside", ("outside: one detent", 1.0)), answer("unknown", 0.01)),
        (truth("outside", ("outside: one detent", 1.0)), answer("effect", 0.01, named)),
    ]
    figures = count([compare(*each) for each in pairs])["blocks"]["rigs"]
    rates = {name: (each["hits"], each["n"]) for name, each in figures["rates"].items()}
    assert rates["one effect: right or in its group"] == (2, 5)
    assert rates["one effect: named right"] == (1, 5)
    # A wrong name, 4 noises left behind `parameters`, a name for what no catalogue has.
    assert rates["hidden: confidently wrong, 3 noises left too"] == (3, 8)
    assert rates["hidden: said to be of right structure"] == (2, 8)
    assert rates["two effects: both named"] == (0, 1)
    assert rates["two effects: one of them, or its group"] == (1, 1)
    assert rates["nothing: alarm"] == (1, 2)
    assert rates["outside: unknown"] == (1, 2)
    assert figures["sizes"]["median_error"]["value"] == pytest.approx(0.05)
    assert len(figures["misses"]) == 5


def test_intervals_of_parameters_are_counted_where_the_truth_is_known():
    rig = {"kind": "slide", "inertia": 2.0, "damping": 30.0, "stiffness": 0.0}
    known = truth("nothing") | {"rig": rig, "friction": {"true": 1.3}}
    parameters = {
        "slide.mass_kg": value(2.05, 1.9, 2.1),
        "symmetric_damping.intercept_n_s_per_mm": value(0.0315, 0.031, 0.032),
        "coulomb_friction.static_n": value(1.25, 1.2, 1.4),
        "spring.stiffness_n_per_mm": value(0.1, 0.0, 0.2),
        "two_way_drive.middle_v": value(5.0, 4.9, 5.1),
    }
    said = answer("parameters", 0.01) | {"parameters": parameters}
    holds = {
        "slide.mass_kg": True,
        "symmetric_damping.intercept_n_s_per_mm": False,
        "coulomb_friction.static_n": True,
    }
    assert compare(known, said).held == holds
    # An incomplete model claims no numbers; a damping by direction has two.
    assert compare(known, said | {"verdict": "unknown"}).held == {}
    two = truth("one effect", ("directional_damping", 0.5)) | {"rig": rig}
    assert compare(two, said).held == {"slide.mass_kg": True}
    not_known = said | {"parameters": {"slide.mass_kg": value(2.05, None, None)}}
    assert compare(known, not_known).held == {}
    station = {"block": "single", "effects": [], "base_factors": {}, "base": {"radius": 0.0254}}
    radius = {"rotor.radius_mm": value(25.5, 25.0, 26.0)}
    assert compare(station, answer("effect", 0.01) | {"parameters": radius}).held == {
        "rotor.radius_mm": True
    }
    counted = count([compare(known, said)])["blocks"]["rigs"]["parameters"]
    assert (counted["covered"]["hits"], counted["covered"]["n"]) == (2, 3)
    effect = truth("one effect", ("coulomb_friction", 2.0)) | {"rig": rig}
    named = answer("effect", 0.01, ("coulomb_friction", {"dynamic_n": value(2.1, 1.9, 2.3)}))
    both = count([compare(known, said), compare(effect, named)])["blocks"]
    both["rigs"]["measured"] = [{"commit": "abc", "date": "2026-11-30", "method": "abc"}]
    assert "| all | 95 % intervals hold, pooled | 75.0 % (30.1-95.4), 3 of 4 |" in report(
        {"seed": 1, "blocks": both}
    )
