"""Every effect of the catalogue: one text, honest units, exactly absent at its neutral value."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pma_gym.effects import CATALOGUE
from pma_gym.effects.arithmetic import exponential
from pma_gym.effects.effect import signals
from pma_gym.effects.ports import measured_output
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.rigs import RIGS
from pma_gym.plant.statics import Condition

PHENOMENA = (
    "muscle_force",
    "muscle_damping",
    "damping_factor",
    "slide_force",
    "drive_shape",
    "drive_delay",
    "drive_lag",
    "drive_ripple",
    "regulator_delay",
    "regulator_pace",
    "chamber",
)
"""Ports that a station can do without, effect by effect."""

LAWS = [
    pytest.param(effect, law, id=law.__name__ if law is effect.law else f"{effect.name}-rate")
    for effect in CATALOGUE.values()
    for law in effect.laws()
]


@pytest.mark.parametrize(("effect", "law"), LAWS)
def test_a_law_says_its_equation_units_and_source(effect, law):
    text = law.__doc__
    for name in signals(law):
        assert f"{name}: " in text
    assert "Returns:" in text
    assert "(" in text.split("Args:")[1]


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda effect: effect.name)
def test_every_quantity_has_unit_bounds_and_source(effect):
    assert effect.quantities.keys() == set(effect.parameters._fields)
    for name, quantity in effect.quantities.items():
        assert quantity.source
        assert -math.inf < quantity.lower < quantity.upper < math.inf
        if quantity.neutral is not None:
            quantity.check(name, quantity.neutral)
    assert len(effect.names_in_files()) == len(effect.parameters._fields)
    assert effect.parameters.__doc__
    ports = {"part", *(port for rig in RIGS.values() for port in rig.ports)}
    assert effect.port in ports or measured_output(effect.port)


@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=lambda effect: effect.name)
def test_the_middle_of_the_bounds_and_usual_values_are_parameter_sets(effect):
    assert set(effect.held) <= effect.quantities.keys()
    assert set(effect.scanned) <= set(effect.held)
    if effect.rows:
        assert effect.name == "position_map"
        return
    assert all(quantity.usual is not None for quantity in effect.quantities.values())
    for values in (effect.start, effect.usual):
        assert effect.parse(effect.values_in_files(values)) == pytest.approx(values, rel=1e-12)
    assert effect.usual != effect.neutral


def test_names_are_unique_and_are_their_keys():
    assert all(effect.name == name for name, effect in CATALOGUE.items())
    # Delays of sensors are one law with one class of parameters.
    laws_of = {(effect.parameters, *effect.laws()) for effect in CATALOGUE.values()}
    assert len(laws_of) == len({effect.parameters for effect in CATALOGUE.values()})
    laws = [(law.__module__, law.__name__) for e in CATALOGUE.values() for law in e.laws()]
    own = [name for _, name in set(laws)]
    # Laws of one plant share its module's names.
    assert len(own) == len(set(own))


def test_a_signature_sets_every_phenomenon_apart():
    for effect in CATALOGUE.values():
        if effect.port in PHENOMENA or (measured_output(effect.port) and effect.law):
            assert effect.signature, effect.name


ADDED = [effect for effect in CATALOGUE.values() if effect.port in PHENOMENA]


SHIPPED = load_model("serres2008")
KEPT = {name: p for name, p in SHIPPED.parameters.items() if name != "coulomb_friction"}
BASE = Model("base", "", "station", KEPT)
SENSORS = ("lvdt", "load_cell", "pressure_transducer", "potentiometer")


def rates(model, states):
    """Rates by name at states given by name; states that only this model has are at zero."""
    plant = Plant(model)
    by_state = {name: [] for name in plant.states}
    for state in states:
        values = np.array([state.get(name, 0.0) for name in plant.states])
        rate = plant.derivative(values, state["motor"], state["regulator"], 0.04)
        for name, value in zip(plant.states, rate, strict=True):
            by_state[name].append(value)
    return by_state


@cache
def some_states():
    """States about rest, by name, with commands."""
    plant, generator, made = Plant(BASE), np.random.default_rng(5), []
    rest = plant.settle(2.0, 300e3)
    for _ in range(20):
        moved = rest.state * (1.0 + 0.1 * generator.standard_normal(rest.state.shape))
        moved += 1e-2 * generator.standard_normal(rest.state.shape)
        commands = {"motor": generator.uniform(0, 10), "regulator": generator.uniform(2, 9)}
        made.append(dict(zip(plant.states, moved, strict=True)) | commands)
    return made


def trajectory(model):
    """Outputs by name under a busy motor and regulator."""
    plant, base = Plant(model), Plant(BASE)
    rest = base.settle(2.0, 300e3)
    settled = dict(zip(base.states, rest.state, strict=True))
    state = np.array([settled.get(name, 0.0) for name in plant.states])
    motor = np.array([2.0, 5.0, 0.0, 4.0, 4.0])
    regulator = np.array([5.4, 6.0, 6.0, 5.0, 5.0])
    start = Condition(state, rest.zero_contraction)
    states, zero = plant.run(0.02 * np.arange(5), motor, regulator, condition=start)
    return plant.observe(states, zero)


@pytest.fixture(scope="module")
def without():
    return trajectory(BASE)


def assert_near(computed, expected):
    """Trajectories equal but for the steps, which an effect's own states may choose otherwise."""
    for name, values in expected.items():
        assert np.abs(computed[name] - values).max() < 2e-5 * np.ptp(values), name


@pytest.mark.parametrize("effect", ADDED, ids=lambda effect: effect.name)
def test_an_effect_at_its_neutral_value_is_exactly_absent(effect, without):
    less = Model("less", "", "station", {n: p for n, p in KEPT.items() if n != effect.name})
    more = Model("with", "", "station", {**less.parameters, effect.name: effect.neutral})
    expected, slopes = (rates(each, some_states()) for each in (less, more))
    for name, values in expected.items():
        np.testing.assert_array_equal(slopes[name], values, err_msg=name)
    assert_near(trajectory(more), trajectory(less) if effect.name in KEPT else without)


def test_a_sensor_does_not_disturb_the_plant(without):
    bare = Model("bare", "", "station", {n: p for n, p in KEPT.items() if n not in SENSORS})
    expected = rates(BASE, some_states())
    for name, values in rates(bare, some_states()).items():
        np.testing.assert_array_equal(values, expected[name])
    assert_near(trajectory(bare), without)


@given(st.floats(-12.0, 12.0))
def test_the_laws_exponential_is_exact_to_1e_12(value):
    assert exponential(value) == pytest.approx(math.exp(value), rel=1e-12)


def test_what_a_file_need_not_name_is_usual_or_absent_and_the_same_as_when_added():
    with_defaults = [effect for effect in CATALOGUE.values() if effect.defaults]
    assert [(effect.name, dict(effect.defaults)) for effect in with_defaults] == [
        ("hysteresis", {"memory_at_start": 0.0}),
        ("drive_dead_zone", {"slope": 2.0}),
        ("contact_friction", {"rise_n": 0.0, "stribeck_speed_mm_per_s": 5.0}),
        ("joint_range", {"arrival": 0.0}),
        ("antagonist_hysteresis", {"memory_at_start": 0.0}),
    ]
    for effect in with_defaults:
        for file_key, value in effect.defaults.items():
            quantity = effect.quantities[effect.names_in_files()[file_key]]
            # A term that the law may lack is absent from older files.
            stem = effect.names_in_files()[file_key]
            lacks = any(stem == size for size, *_ in effect.terms)
            assert value == (quantity.neutral if lacks else quantity.usual)
    given = {"width_n": 15.0}
    added = load_model("station").with_effects({"drive_dead_zone": given})
    assert added.parameters["drive_dead_zone"] == CATALOGUE["drive_dead_zone"].parse(given)
    with pytest.raises(ValueError, match=r"missing: width_n; slope may be left out \(2\)"):
        CATALOGUE["drive_dead_zone"].parse({})
