"""Models: read, written, changed, copied; and what is said about a broken one.

Effects of the catalogue added to a model.
"""

import copy
import pickle
from types import MappingProxyType

import numpy as np
import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import (
    Model,
    ModelError,
    dump_model,
    load_model,
    parse_model,
    shipped_models,
)
from pma_gym.plant.parameter_rows import Note

SHIPPED = sorted(shipped_models())


STATION = load_model("station")


SERRES = load_model("serres2008")


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_model_survives_its_own_file(name, tmp_path):
    model = load_model(name)
    assert model.name == name
    path = tmp_path / "copy.toml"
    path.write_text(dump_model(model), encoding="utf-8")
    again = load_model(path)
    assert again.parameters == model.parameters
    assert again.notes == model.notes
    assert (again.name, again.title, again.plant) == (model.name, model.title, model.plant)
    assert dump_model(again) == dump_model(model)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_number_of_a_shipped_model_has_a_source(name):
    model = load_model(name)
    assert set(model.notes) == set(model.paths())
    assert all(note.source for note in model.notes.values())
    for note in model.notes.values():
        assert (note.low is None) == (note.high is None)


def test_intervals_contain_their_values():
    known = {path: note for path, note in STATION.notes.items() if note.low is not None}
    assert known
    for path, note in known.items():
        effect, _, name = path.partition(".")
        assert note.low < STATION.values_in_files(effect)[name] < note.high


def test_the_literatures_models_differ_from_serres2008_in_the_muscle_alone():
    for model in map(load_model, set(SHIPPED) - {"serres2008", "station", "cascade"}):
        if not model.rig.balances_loads:
            continue
        for effect, values in model.parameters.items():
            if CATALOGUE[effect].port not in ("muscle_force", "muscle_damping"):
                kept = values._replace(**({"contraction": 0.07} if effect == "limits" else {}))
                assert kept == SERRES.parameters[effect]


def test_copies_and_pickles_are_equal():
    for other in (copy.deepcopy(STATION), pickle.loads(pickle.dumps(STATION))):
        assert other.parameters == STATION.parameters
        assert dict(other.notes) == dict(STATION.notes)
        assert other.name == STATION.name
        assert isinstance(other.parameters, MappingProxyType)
        np.testing.assert_array_equal(other.vector(), STATION.vector())


def test_a_model_cannot_be_changed_in_place():
    with pytest.raises(TypeError):
        SERRES.parameters["drive"] = None  # type: ignore[index]
    with pytest.raises(AttributeError):
        SERRES.parameters["drive"].gain = 1.0
    with pytest.raises(AttributeError):
        SERRES.name = "other"  # type: ignore[misc]


def test_replace_changes_what_is_named_and_nothing_else():
    other = STATION.replace({"drive.gain_n_per_v": 100.0, "cable.slack_mm": 2.0}, name="tuned")
    assert other.name == "tuned"
    assert other.parameters["drive"].gain == 100.0
    assert other.parameters["cable"].slack == pytest.approx(2e-3, rel=1e-15)
    assert other.parameters["drive"].offset == STATION.parameters["drive"].offset
    changed = {
        name for name in STATION.parameters if STATION.parameters[name] != other.parameters[name]
    }
    assert changed == {"drive", "cable"}
    assert "drive.gain_n_per_v" not in other.notes
    assert other.notes["drive.offset_n"] == STATION.notes["drive.offset_n"]
    assert STATION.replace({}).parameters == STATION.parameters


def test_replace_refuses_what_it_does_not_know_or_may_not_be():
    with pytest.raises(
        ModelError, match=r"no parameter drive\.gain; did you mean drive.gain_n_per"
    ):
        SERRES.replace({"drive.gain": 1.0})
    with pytest.raises(ModelError, match=r"drive\.gain_n_per_v must lie in 1 to 1000 N/V, got 0"):
        SERRES.replace({"drive.gain_n_per_v": 0})
    with pytest.raises(ModelError, match=r"must be a number in N/V, got 'strong'"):
        SERRES.replace({"drive.gain_n_per_v": "strong"})  # type: ignore[dict-item]


def test_text_with_any_character_survives():
    title = 'a "quoted" \\ title,\nof two lines, µ\t.'
    notes = {"drive.offset_n": Note('by "hand"', -1.0, 2.5)}
    model = Model(SERRES.name, title, SERRES.plant, SERRES.parameters, notes)
    import tomllib

    again = parse_model(tomllib.loads(dump_model(model)))
    assert again.title == title
    assert again.notes["drive.offset_n"] == notes["drive.offset_n"]


GOOD = dump_model(SERRES)
CASCADE = dump_model(load_model("cascade"))


def without(text, table):
    """The text of a model without one of its tables."""
    begin = text.index(f"[{table}]")
    end = text.find("\n[", begin)
    return text[:begin] + text[end + 1 :]


BROKEN = {
    "not TOML": (
        GOOD.replace("[drive]", "[drive"),
        r"is not valid TOML: line \d+, '\[drive': Expected .*; a line is a table, \[effect\], or",
    ),
    "no value of TOML": ("schema = None\n", "line 1, 'schema = None': .*the value a number 1.5, a"),
    "unended text": ('schema = 1\nname = """x\n', 'line 2, \'name = """x\': Unterminated string'),
    "other schema": (
        GOOD.replace("schema = 1", "schema = 7"),
        "schema must be 1, .*, got 7; write schema = 1 as the first line",
    ),
    "no schema": (
        GOOD.replace("schema = 1\n", ""),
        "schema must be 1, .*, there is none; write schema = 1 as the first line",
    ),
    "no head": (GOOD.replace('plant = "station"\n', ""), "a model needs .* missing: plant"),
    "unknown plant": (
        GOOD.replace('"station"', '"rig"'),
        "one of station, cascade, slide, joint, imposed, .*, got 'rig'",
    ),
    "unknown effect": (
        GOOD.replace("[coulomb_friction]", "[coulomb_fricton]"),
        r"unknown effect \[coulomb_fricton\]; did you mean \[coulomb_friction\]\?",
    ),
    "far from any effect": (
        GOOD + "\n[zzz]\na = 1\n",
        r"unknown effect \[zzz\]; known: contractile",
    ),
    "missing parameter": (
        GOOD.replace("mass_kg", "weight_kg"),
        r"\[slide\] takes mass_kg; unknown: weight_kg, missing: mass_kg",
    ),
    "out of bounds": (
        GOOD.replace("value = 97.84", "value = 97840"),
        r"drive.gain_n_per_v must lie in 1 to 1000 N/V, got 97840; check unit and decimal point "
        r"\(usual: Serres 2008",
    ),
    "not a number": (
        GOOD.replace("value = nan", "").replace("value = 97.84", "value = nan"),
        r"drive.gain_n_per_v must lie in 1 to 1000 N/V, got nan",
    ),
    "text in a number": (
        GOOD.replace("value = 97.84", 'value = "98 N/V"'),
        r"drive.gain_n_per_v must be a number in N/V, got '98 N/V'",
    ),
    "truth in a number": (GOOD.replace("value = 97.84", "value = true"), "number in N/V, got True"),
    "a list for a number": (
        GOOD.replace("value = 97.84", "value = [97, 98]"),
        r"drive.gain_n_per_v must be one number in N/V, got \[97, 98\]",
    ),
    "a number for a list": (
        CASCADE.replace("pressure_kpa = { value = [", "pressure_kpa = { value = 1, x = ["),
        r"position_map.pressure_kpa must be a number, or a table of value, low and high",
    ),
    "a row that falls": (
        CASCADE.replace("[150, 200, 250", "[250, 200, 150"),
        r"pressure of \[position_map\] must increase",
    ),
    "rows of two lengths": (
        CASCADE.replace("[150, 200, 250", "[200, 250"),
        r"rows of \[position_map\] must have one length, 2 or more; got pressure 10, square 11",
    ),
    "text for a bound": (
        GOOD.replace("value = 97.84", 'value = 97.84, low = "90"'),
        "table of value, low and high .numbers.",
    ),
    "a number for a table": ("drive = 3\n" + without(GOOD, "drive"), "drive = 3 is no table"),
    "missing part": (
        without(GOOD, "slide"),
        r"a station needs \[slide\]; copy it from the shipped model serres2008",
    ),
    "missing port": (
        without(GOOD, "drive"),
        r"port drive of a station takes exactly one effect: load that .*; got none of drive",
    ),
    "no muscle": (
        without(without(GOOD, "contractile_force"), "stiffness"),
        "port muscle_force of a station takes 1 or more effects: .* got none of contractile_force",
    ),
    "foreign port": (
        GOOD + "\n[servo]\nstiffness_n_m = 10\ndamping_n_m_s = 1e-3\nradius_mm = 25\n",
        r"\[servo\] acts at port servo, which a station does not have; its ports: muscle_force",
    ),
    "an effect that a cascade would ignore": (
        CASCADE
        + "\n[repperger_spring]\nstiffness_n_per_mm = 1\nstiffening_n_per_mm_per_kpa = 0\n"
        + "linear_n_per_mm2 = 0\nquadratic_n_per_mm3 = 0\n",
        "port muscle_force of a cascade takes contractile_force and stiffness",
    ),
    "no bandwidth": (
        GOOD.replace("bandwidth_hz = { value = 100", "bandwidth_hz = { value = 0"),
        r"lvdt.bandwidth_hz must lie in 1 to 100000 Hz, got 0; a sensor without lag and noise is "
        "one without its table: leave that out",
    ),
    "a damping by speed in a cascade": (
        without(CASCADE, "damping")
        + "\n[repperger_damping]\nviscous_n_s_per_mm = 1\nstiffening_n_s_per_mm_per_kpa = 0\n"
        + "speed_slope_n_s2_per_mm2 = 0.1\n",
        r"a cascade cannot have \[repperger_damping\]: .* only the sign; take \[damping\] or",
    ),
    "two dampings in a cascade": (
        CASCADE + "\n[symmetric_damping]\nintercept_n_s_per_mm = 1\nslope_n_s_per_mm_per_kpa = 0\n",
        "port muscle_damping of a cascade takes exactly one effect",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_refused_by_name_and_rule(case, tmp_path):
    text, message = BROKEN[case]
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=message) as caught:
        load_model(path)
    assert str(path) in str(caught.value)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b'schema = 1\nname = "\xff\xfe"')
    with pytest.raises(ModelError, match=r"not UTF-8 text \(byte \d+\); save it as UTF-8"):
        load_model(path)


def test_no_such_model_names_the_nearest(tmp_path):
    with pytest.raises(ModelError, match=r"no model 'stations': give .*; did you mean 'station'\?"):
        load_model("stations")


def test_a_path_that_leads_to_no_model_file_is_said_to_be_that(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    (tmp_path / "mine.txt").touch()
    for source, message in {
        "nowhere.toml": f"no such file nowhere.toml in {tmp_path}; check the name and the folder",
        "mien.toml": f"no such file mien.toml in {tmp_path}; did you mean mine.toml?",
        "sub/station": f"no such file sub/station in {tmp_path}: there is no folder sub; check",
        str(tmp_path / "x.toml"): f"no such file {tmp_path}/x.toml; check",
        str(tmp_path): f"{tmp_path} is a folder; give the path of a .toml file in it",
        "./mine.txt": "mine.txt must end in .toml; rename it",
        "/dev/null": "/dev/null is no ordinary file",
    }.items():
        with pytest.raises(ModelError) as caught:
            load_model(source)
        assert str(caught.value).startswith(message)


def test_a_model_built_in_code_is_checked_as_a_file_is():
    parameters = dict(SERRES.parameters)
    parameters["sarosi_forse"] = parameters["drive"]
    with pytest.raises(
        ModelError, match=r"unknown effect \[sarosi_forse\]; did you mean \[sarosi_"
    ):
        Model("mine", "", "station", parameters)


def test_names_add_what_is_there_and_does_nothing():
    more = SERRES.with_effects(["regulator_asymmetry", "hysteresis"])
    assert set(more.parameters) - set(SERRES.parameters) == {"hysteresis", "regulator_asymmetry"}
    for name in ("hysteresis", "regulator_asymmetry"):
        assert more.parameters[name] == CATALOGUE[name].neutral
    assert list(more.parameters) == [name for name in CATALOGUE if name in more.parameters]
    assert dict(more.notes) == dict(SERRES.notes) and more.name == SERRES.name


def test_the_order_given_does_not_matter():
    names = ["hand_push", "hysteresis", "regulator_asymmetry"]
    assert dump_model(SERRES.with_effects(names)) == dump_model(SERRES.with_effects(names[::-1]))


def test_values_are_given_as_in_files_and_the_rest_is_neutral():
    more = SERRES.with_effects({"hysteresis": {"force_n": 12.0}}, name="sticky")
    assert more.name == "sticky"
    assert more.parameters["hysteresis"].force == 12.0
    assert more.parameters["hysteresis"].distance == CATALOGUE["hysteresis"].neutral.distance


def test_what_a_model_has_stays_to_the_last_bit():
    again = STATION.with_effects(["hysteresis", "sarosi_force", "cable"])
    assert again == STATION and again.vector().tobytes() == STATION.vector().tobytes()
    changed = STATION.with_effects({"hysteresis": {"force_n": 9.0}})
    assert changed.parameters["hysteresis"].distance == STATION.parameters["hysteresis"].distance
    assert "hysteresis.force_n" not in changed.notes
    assert changed.notes["hysteresis.distance_mm"] == STATION.notes["hysteresis.distance_mm"]


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        (["hysteresys"], ["unknown effect [hysteresys]", "did you mean [hysteresis]?"]),
        ({"hysteresis": {"force": 1.0}}, ["[hysteresis]", "force;", "force_n, distance_mm"]),
        ({"hysteresis": {"force_n": 1e3}}, ["hysteresis.force_n", "0 to 200 N", "1000"]),
        ({"hysteresis": {"force_n": "much"}}, ["hysteresis.force_n", "number in N", "'much'"]),
        (["position_map"], ["[position_map]", "no neutral values", "pressure_kpa"]),
        (["servo"], ["[servo]", "no neutral values", "give stiffness_n_m"]),
        ({"servo_inertia": {"inertia_kg_m2": 1e-3, "damping_ratio": 0.7}}, ["port servo_inertia"]),
        ("hysteresis", ["a list of names or a dict", "'hysteresis'"]),
    ],
)
def test_mistakes_are_named(effects, words):
    with pytest.raises(ModelError) as caught:
        SERRES.with_effects(effects)
    for word in words:
        assert word in str(caught.value)
