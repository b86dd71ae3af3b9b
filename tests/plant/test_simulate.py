"""Whole trials through a plant: commands in, the station's log out.

At rest nothing moves; what cannot rest is refused.
"""

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.plant.model import load_model, shipped_models
from pma_gym.plant.plant import Plant

SERRES = Plant("serres2008")


def trial(time, **commands):
    rows = len(time)
    arrays = {name: np.broadcast_to(value, rows) for name, value in commands.items()}
    return Trial(time=np.asarray(time), commands=arrays, provenance={"note": "mine"})


@pytest.fixture(scope="module")
def plant():
    return Plant("serres2008")


WHEN = np.linspace(0.0, 1.0, 51)


def test_a_simulated_trial_says_what_and_how(plant):
    run = plant.simulate(trial(WHEN, motor_voltage=3.0, regulator_voltage=6.0), seed=4)
    assert set(run.measurements) == {"contraction", "rotation", "load", "pressure"}
    assert set(run.truth) == {*run.measurements, "extension"}
    expected = {"note": "mine", "model": "serres2008", "noise": "True", "seed": "4"}
    assert dict(run.provenance) == expected
    assert len(run) == 51
    np.testing.assert_array_equal(run.commands["motor_voltage"], np.full(51, 3.0))


def test_loads_and_pressures_command_as_their_voltages_do(plant):
    motor, regulator = 2.0 + np.sin(3.0 * WHEN), np.linspace(5.0, 6.0, 51)
    volts = plant.simulate(trial(WHEN, motor_voltage=motor, regulator_voltage=regulator))
    wishes = plant.simulate(
        trial(
            WHEN,
            load_command=97.84 * motor - 2.0,
            pressure_command=(59.9 * regulator - 20.4) * 1e3,
        )
    )
    for name in volts.truth:
        np.testing.assert_allclose(wishes.truth[name], volts.truth[name], rtol=1e-9, atol=1e-9)
    both = plant.simulate(
        trial(WHEN, motor_voltage=motor, load_command=0.0, regulator_voltage=regulator)
    )
    np.testing.assert_array_equal(both.truth["load"], volts.truth["load"])


def test_uneven_times_lie_on_the_same_trajectory(plant):
    every = np.linspace(0.0, 1.0, 101)
    kept = np.sort(np.random.default_rng(1).choice(np.arange(1, 100), 30, replace=False))
    few = np.concatenate([[0.0], every[kept], [1.0]])
    motor = 1.0 + 2.0 * every
    dense = plant.simulate(trial(every, motor_voltage=motor, regulator_voltage=6.0), noise=False)
    sparse = plant.simulate(
        trial(few, motor_voltage=1.0 + 2.0 * few, regulator_voltage=6.0), noise=False
    )
    rows = [0, *kept, 100]
    for name, values in dense.truth.items():
        away = np.abs(sparse.truth[name] - values[rows]).max()
        assert away <= 1e-6 * np.ptp(values) + 1e-12 * abs(values[0])


def test_held_commands_come_later_than_joined_ones(plant):
    coarse = np.linspace(0.0, 1.0, 6)
    ramp = trial(coarse, motor_voltage=1.0 + 3.0 * coarse, regulator_voltage=6.0)
    linear, held = (plant.simulate(ramp, noise=False, interpolation=how) for how in ("foh", "zoh"))
    assert np.all(held.truth["extension"][1:] < linear.truth["extension"][1:])
    staircase = 1.0 + 3.0 * np.floor(np.linspace(0.0, 0.9999, 2001) * 5.0) / 5.0
    fine = np.linspace(0.0, 1.0, 2001)
    stepped = plant.simulate(
        trial(fine, motor_voltage=staircase, regulator_voltage=6.0),
        noise=False,
        interpolation="zoh",
    )
    np.testing.assert_allclose(
        held.truth["extension"], stepped.truth["extension"][::400], atol=2e-5
    )


def test_an_empty_cell_holds_the_last_command(plant):
    motor = np.where(WHEN < 0.5, 2.0, 3.0)
    gaps = motor.copy()
    gaps[1:25], gaps[30:] = np.nan, np.nan
    full, holey = (
        plant.simulate(trial(WHEN, motor_voltage=volts, regulator_voltage=6.0))
        for volts in (motor, gaps)
    )
    np.testing.assert_array_equal(full.truth["load"], holey.truth["load"])


def test_missing_commands_are_named(plant):
    with pytest.raises(ValueError, match="not command the motor: give motor_voltage_v or load_com"):
        plant.simulate(trial(WHEN, regulator_voltage=6.0))
    with pytest.raises(ValueError, match="the regulator: give regulator_voltage_v or pressure_com"):
        plant.simulate(trial(WHEN, motor_voltage=3.0))
    late = np.where(WHEN > 0.2, 3.0, np.nan)
    with pytest.raises(ValueError, match="motor_voltage_v has no value in sample 0, the first"):
        plant.simulate(trial(WHEN, motor_voltage=late, regulator_voltage=6.0))
    cascade = Plant("cascade")
    with pytest.raises(ValueError, match="not command the motor: give motor_voltage_v$"):
        cascade.simulate(trial(WHEN, load_command=100.0, regulator_voltage=6.0))


def test_a_muscle_that_runs_away_is_lost_at_once():
    """Softer than its force grows: a step of pressure leaves it nowhere to stop."""
    softening = {"linear": -1.145, "quadratic": -2.29}
    model = load_model("serres2008").with_effects(
        {"nonlinear_stiffness": {**softening, "stiffness_n_per_mm": 20, "resting_length_mm": 250}}
    )
    model = model.replace({"contractile_force.slope_n_per_kpa": 2.4})
    asked = trial([0.0, 5.0, 10.0, 15.0], motor_voltage=0.0, regulator_voltage=[1.5, 9.0, 9.0, 9.0])
    assert abs(Plant(model).simulate(asked, noise=False).truth["contraction"][-1]) > 1.0


LAWS = sorted(set(shipped_models()) - {"serres2008", "station", "cascade"})


@pytest.mark.parametrize("model", sorted(shipped_models()))
def test_nothing_moves_at_rest(model):
    plant = Plant(model)
    for pressure in (200e3, 314e3, 430e3, 575e3):
        for voltage in (0.0, 0.5, 2.0, 4.5):
            rest = plant.settle(voltage, pressure)
            rates = plant.derivative(
                rest.state, voltage, plant.regulator_voltage(pressure), rest.zero_contraction
            )
            # Forces of 1e3 N over 0.5 kg, balanced to rounding; pressures of 5e5 Pa at 600 1/s.
            scale = np.where(["pressure" in name for name in plant.states], 1e-5, 1e-6)
            assert np.all(np.abs(rates) < scale)
            truth = plant.observe(rest.state[None, :], rest.zero_contraction)
            assert truth["pressure"][0] == pytest.approx(pressure, rel=1e-12)
            assert truth["extension"][0] >= -1e-12
            if voltage == 0.0:
                assert truth["extension"][0] == pytest.approx(0.0, abs=1e-12)
                assert truth["load"][0] == pytest.approx(0.0, abs=1e-9)


def test_serres2008_rests_where_its_three_elements_say():
    rest = Plant("serres2008").settle(3.0, 250e3)
    stiffness, load = 32.7 - 0.0321 * 250.0, 97.84 * 3.0 - 2.0
    assert rest.zero_contraction * 1e3 == pytest.approx((2.91 * 250.0 + 44.6) / stiffness)
    assert rest.state[0] * 1e3 == pytest.approx((2.91 * 250.0 + 44.6 - load) / stiffness)


def test_what_no_muscle_balances_is_refused():
    for message, act in (
        (r"balances a load of 976\.4 N .*lower the first motor", lambda: SERRES.settle(10.0, 50e3)),
        ("no contraction between -24 and 180 mm", lambda: Plant("schulte").settle(3.0, 0.0)),
        ("what the regulator reaches with 0-10 V; got 900 kPa", lambda: SERRES.settle(0.0, 900e3)),
        (r"settle\(\) needs a pressure", lambda: SERRES.settle(1.0)),
    ):
        with pytest.raises(ValueError, match=message):
            act()


@pytest.mark.parametrize("model", LAWS)
def test_each_law_of_the_literature_settles_and_moves_stably(model):
    loaded = load_model(model)
    plant = Plant(loaded)
    for pressure in (200e3, 300e3, 400e3, 575e3):
        rest = plant.settle(0.0, pressure)
        zero = rest.zero_contraction
        assert 0.02 < zero < loaded.parameters["limits"].contraction
        assert loaded.parameters["limits"].pressure >= pressure
    rest = plant.settle(0.0, 300e3)
    regulator = plant.regulator_voltage(300e3)
    held = plant.settle(1.5, 300e3)
    for _ in range(150):
        plant.step(rest, 1.5, regulator, 0.01)
    stroke = rest.zero_contraction - held.state[0]
    assert rest.state[0] == pytest.approx(held.state[0], abs=0.05 * stroke)
