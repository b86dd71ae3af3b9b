"""Effects of the catalogue added to a model."""

import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import ModelError, dump_model, load_model

BARE = load_model("serres2008")


def test_names_add_what_is_there_and_does_nothing():
    more = BARE.with_effects(["regulator_asymmetry", "hysteresis"])
    assert set(more.parameters) - set(BARE.parameters) == {"hysteresis", "regulator_asymmetry"}
    for name in ("hysteresis", "regulator_asymmetry"):
        assert more.parameters[name] == CATALOGUE[name].neutral
    assert list(more.parameters) == [name for name in CATALOGUE if name in more.parameters]
    assert dict(more.notes) == dict(BARE.notes) and more.name == BARE.name


def test_the_order_given_does_not_matter():
    names = ["hand_push", "hysteresis", "regulator_asymmetry"]
    assert dump_model(BARE.with_effects(names)) == dump_model(BARE.with_effects(names[::-1]))


def test_values_are_given_as_in_files_and_the_rest_is_neutral():
    more = BARE.with_effects({"hysteresis": {"force_n": 12.0}}, name="sticky")
    assert more.name == "sticky"
    assert more.parameters["hysteresis"].force == 12.0
    assert more.parameters["hysteresis"].distance == CATALOGUE["hysteresis"].neutral.distance


def test_what_a_model_has_stays_to_the_last_bit():
    station = load_model("station")
    again = station.with_effects(["hysteresis", "sarosi_force", "cable"])
    assert again == station and again.vector().tobytes() == station.vector().tobytes()
    changed = station.with_effects({"hysteresis": {"force_n": 9.0}})
    assert changed.parameters["hysteresis"].distance == station.parameters["hysteresis"].distance
    assert "hysteresis.force_n" not in changed.notes
    assert changed.notes["hysteresis.distance_mm"] == station.notes["hysteresis.distance_mm"]


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
        BARE.with_effects(effects)
    for word in words:
        assert word in str(caught.value)
