"""Linearised and symbolic: the same plant as the simulated one."""

import control
import numpy as np
import pytest
import sympy

from pma_gym.plant.forms.linear import linearize, operating_point
from pma_gym.plant.forms.symbolic import symbolic
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

PLANT = Plant("serres2008")


@pytest.mark.parametrize(
    ("model", "direction", "sign"),
    [
        ("station", "relaxing", 1.0),
        ("cascade", "contracting", -1.0),
    ],
)
def test_a_small_step_is_the_linear_systems(model, direction, sign):
    loaded = load_model(model)
    if "coulomb_friction" in loaded.parameters:
        # The linear system slides; so must the plant, which would stick under a small step.
        loaded = loaded.replace(
            {"coulomb_friction.static_n": 0.0, "coulomb_friction.dynamic_n": 0.0}
        )
    if "hysteresis" in loaded.parameters:
        loaded = loaded.replace({"hysteresis.force_n": 0.0})
    plant = Plant(loaded)
    system = linearize(plant, 300e3, 0.025, direction)
    start, (motor, regulator) = operating_point(plant, 300e3, 0.025)
    when, step = np.linspace(0.0, 0.3, 61), sign * 1e-3
    # While it swings through zero velocity the damping changes: what is linear is the way there.
    states, zero = plant.run(
        when, np.full(61, motor + step), np.full(61, regulator), condition=start
    )
    truth = plant.observe(states, zero)
    expected = control.forced_response(system, when, np.vstack([np.full(61, step), np.zeros(61)]))
    for row, name in enumerate(system.output_labels):
        moved = truth[name] - truth[name][0]
        away = np.abs(moved - np.asarray(expected.outputs)[row]).max()
        assert away <= 0.01 * np.ptp(moved) + 1e-11 * abs(truth[name][0])


def test_the_poles_of_the_cascade_are_those_of_eq_22():
    plant = Plant("cascade")
    system = linearize(plant, 250e3, 0.02, "relaxing")
    stiffness = 32.7 - 0.0321 * 250.0
    # Twice the muscle's: it follows its motor and its own pressure at one pace (Eq. 16).
    expected = [-10.26 / 7.64e-4, -stiffness / 1.57, -stiffness / 1.57, -10.0]
    assert sorted(system.poles().real) == pytest.approx(sorted(expected), rel=1e-6)
    contracting = linearize(plant, 250e3, 0.02, "contracting").poles().real
    assert np.abs(contracting + stiffness / 2.90).min() < 1e-5


def test_the_stations_matrix_is_its_springs_dampers_and_masses():
    system = linearize(PLANT, 300e3, 0.02, "relaxing")
    part = PLANT.model.parameters
    at = {name: i for i, name in enumerate(system.state_labels)}
    mass, inertia, radius = part["slide"].mass, part["rotor"].inertia, part["rotor"].radius
    stiffness, cable = (32.7 - 0.0321 * 300.0) * 1e3, part["cable"].stiffness
    assert system.A[at["contraction"], at["velocity"]] == pytest.approx(1.0)
    entry = system.A[at["velocity"], at["contraction"]]
    assert entry == pytest.approx(-(stiffness + cable) / mass, rel=1e-4)
    assert system.A[at["spin"], at["angle"]] == pytest.approx(
        -radius * radius * cable / inertia, rel=1e-4
    )
    force = part["contractile_force"].slope + 0.0321 * 0.02
    assert system.A[at["velocity"], at["pressure"]] == pytest.approx(force / mass, rel=1e-4)
    assert system.B[at["spin"], 0] == pytest.approx(radius * part["drive"].gain / inertia, rel=1e-6)
    assert system.B[at["pressure"], 1] == pytest.approx(59.9e3 / 0.1, rel=1e-6)
    # At rest more load goes into the muscle's spring: the steady gains follow.
    gains = np.asarray(system.dcgain())
    outputs = {name: i for i, name in enumerate(system.output_labels)}
    assert gains[outputs["load"], 0] == pytest.approx(97.84, rel=1e-3)
    assert gains[outputs["extension"], 0] == pytest.approx(97.84 / stiffness, rel=1e-3)
    assert gains[outputs["pressure"], 1] == pytest.approx(59.9e3, rel=1e-4)
    assert np.all(system.poles().real < 0.0)


def test_signals_have_names():
    system = linearize(Plant("station"), 400e3, 0.04)
    assert system.state_labels == ["contraction", "velocity", "angle", "spin", "pressure"]
    assert system.input_labels == ["motor_voltage", "regulator_voltage"]
    assert system.output_labels == ["contraction", "rotation", "load", "pressure", "extension"]
    assert system.name == "station"


def test_refusals_say_what_can_be_reached():
    for message, act in (
        (r"must lie in .* to 39.77 mm .* got 45 mm", lambda: linearize(PLANT, 300e3, 0.045)),
        (r"what a motor voltage of 0 to .* V holds", lambda: linearize(PLANT, 300e3, -0.05)),
        ("pressure must lie in 0 to 578.6 kPa", lambda: linearize(PLANT, 700e3, 0.02)),
        (
            "direction must be one of contracting, relaxing",
            lambda: linearize(PLANT, 300e3, 0.02, "sideways"),
        ),
    ):
        with pytest.raises(ValueError, match=message):
            act()


def numerical(plant, rates):
    """The symbolic rates as a function of state, motor, regulator and zero contraction."""
    known, rows = {}, {}
    for effect, parameters in plant.model.parameters.items():
        for name, value in parameters._asdict().items():
            if isinstance(value, tuple):
                rows[f"{effect}_{name}"] = value
            else:
                known[f"{effect}.{name}"] = value
    knots = plant.model.parameters["position_map"].pressure if rows else ()
    heights = {
        name: (lambda at, row=row: np.interp(float(at), knots, row)) for name, row in rows.items()
    }
    names = [*plant.states, "motor_voltage", "regulator_voltage", "zero_contraction", *known]
    symbols = [sympy.Symbol(name, real=True) for name in names]
    evaluate = sympy.lambdify(symbols, list(rates.values()), modules=[heights, "math"])
    return lambda state, *given: np.array(evaluate(*state, *given, *known.values()))


INERTIAL = load_model("cascade").with_effects(
    {"servo_inertia": {"inertia_kg_m2": 2e-3, "damping_ratio": 0.7}}
)


@pytest.mark.parametrize("model", ["station", INERTIAL])
def test_the_equations_are_what_is_simulated(model):
    plant = Plant(model)
    rates = symbolic(plant)
    assert list(rates) == plant.states
    evaluate, generator = numerical(plant, rates), np.random.default_rng(3)
    rest = plant.settle(3.0, 330e3)
    for _ in range(4):
        state = rest.state * (1.0 + 0.05 * generator.standard_normal(rest.state.shape))
        state += 1e-3 * generator.standard_normal(rest.state.shape)
        commands = 3.0 + generator.standard_normal(), 6.0 + generator.standard_normal()
        computed = evaluate(state, *commands, rest.zero_contraction)
        expected = plant.derivative(state, *commands, rest.zero_contraction)
        # The law's own exponential is exact to 1e-11.
        np.testing.assert_allclose(computed, expected, rtol=1e-9, atol=1e-7)


def test_the_equations_read_well():
    rates = symbolic(Plant("serres2008"))
    assert rates["contraction"] == sympy.Symbol("velocity", real=True)
    assert rates["spin"].has(sympy.Max)
    cascade = symbolic(Plant("cascade"))
    assert "position_map_linear(pressure)" in str(cascade["servo"])
    assert not cascade["servo"].has(sympy.Symbol("position_map.linear[3]", real=True))


def test_a_plant_gives_both_itself():
    system = PLANT.linearize(300e3, 0.025)
    np.testing.assert_array_equal(system.A, linearize(PLANT, 300e3, 0.025).A)
    assert system.input_labels == ["motor_voltage", "regulator_voltage"]
    assert list(PLANT.symbolic()) == PLANT.states
