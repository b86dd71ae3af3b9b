"""Whole trials through a plant: commands in, the station's log out.

At rest nothing moves; what cannot rest is refused.

Trials begin where the muscle stands: its hysteresis as the model, the trial or a fit says.
"""

import numpy as np
import pytest

from pma_gym.data.trial import Trial, TrialError
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.memory_start import begun_at, memory_starts
from pma_gym.plant.model import load_model, shipped_models
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import muscle_force
from tests.discovery.laboratory import fitted

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


STATIONS = sorted(n for n in shipped_models() if load_model(n).rig.has_muscle)
LAWS = sorted(set(STATIONS) - {"serres2008", "station", "cascade"})


@pytest.mark.parametrize("model", STATIONS)
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


FORCE, DISTANCE, BEGUN = 18.0, 1.8, 0.75
SIZES = {"force_n": FORCE, "distance_mm": DISTANCE, "memory_at_start": BEGUN}
MODEL = load_model("serres2008").with_effects({"hysteresis": SIZES})
AT_ZERO = MODEL.replace({"hysteresis.memory_at_start": 0.0})


def pulled(memory_at_start=None, most=3.0, seconds=4.0, rate=100.0):
    """Commands that pull the muscle out and let it go again, at 300 kPa."""
    time = np.arange(round(seconds * rate)) / rate
    volts = most * (1.0 - np.abs(2.0 * time / seconds - 1.0))
    commands = {"motor_voltage": volts, "pressure_command": np.full(time.size, 300e3)}
    return Trial(time, commands, memory_at_start=memory_at_start)


def test_at_rest_the_muscle_balances_what_its_memory_holds():
    rest = Plant(MODEL).settle(0.0, 300e3)
    force = muscle_force(MODEL)(np.array([300e3]), np.array([rest.zero_contraction]))[0]
    assert force == pytest.approx(BEGUN * FORCE, rel=1e-9)
    assert rest.state[Plant(MODEL).states.index("memory_hysteresis")] == BEGUN
    # It has contracted less far: the force that it lacks, over its stiffness.
    short = Plant(AT_ZERO).settle(0.0, 300e3).zero_contraction - rest.zero_contraction
    assert short == pytest.approx(BEGUN * FORCE / (32.7 - 0.0321 * 300.0) * 1e-3, rel=1e-6)


def test_a_pull_from_the_filled_branch_meets_twice_the_hysteresis():
    """From 0 the force falls by H over the distance; from +0.75 by 1.75 H: it gives way earlier."""
    commands = pulled(most=5.0)
    first, second = (
        Plant(model).simulate(commands, noise=False).truth["extension"]
        for model in (MODEL, AT_ZERO)
    )
    half = first.size // 2
    # Both stand on the same branch at the top, from zeros that differ by 0.75 H over K.
    stiffness = (32.7 - 0.0321 * 300.0) * 1e3
    less = BEGUN * FORCE / stiffness
    assert second[half] - first[half] == pytest.approx(less, rel=0.03)


def test_a_trial_says_where_it_begins():
    said = Plant(AT_ZERO).simulate(pulled(BEGUN), noise=False)
    own = Plant(MODEL).simulate(pulled(), noise=False)
    assert said.memory_at_start == BEGUN and own.memory_at_start is None
    assert said.truth["extension"].tobytes() == own.truth["extension"].tobytes()


@pytest.mark.parametrize("value", [1.5, float("nan"), "full", True])
def test_what_no_memory_is_is_refused(value):
    with pytest.raises(TrialError, match=r"memory_at_start of a trial must be a number in -1 to 1"):
        pulled(value)
    with pytest.raises(TrialError, match="memory_at_start of episodes"):
        PMAEnv("displacement", model=MODEL, memory_at_start=value)


def test_a_model_without_hysteresis_has_nothing_to_begin_with():
    bare = load_model("serres2008")
    assert memory_starts(bare) == () and begun_at(bare, 0.5) == bare
    assert memory_starts(MODEL) == ("hysteresis.memory_at_start",)


def test_an_environment_begins_where_its_option_says_one_or_many():
    options = {"model": AT_ZERO, "pressure_kpa": 300.0, "control_rate_hz": 20.0, "noise": False}
    rest = Plant(MODEL).settle(0.0, 300e3)
    env = PMAEnv("displacement", memory_at_start=BEGUN, **options)
    env.reset(seed=1)
    assert env.nominal_plant.model.parameters == MODEL.parameters
    assert env.truth["contraction"] == pytest.approx(rest.zero_contraction)
    many = PMAVectorEnv(3, "displacement", memory_at_start=BEGUN, **options)
    many.reset(seed=1)
    zero = many.engine.state_layout.offsets["zero_contraction"]
    assert many.engine.records[0, zero, 0] == pytest.approx(rest.zero_contraction, rel=1e-12)
    memory = many.engine.state_layout.offsets["memory_hysteresis"]
    assert many.engine.records[0, memory, 0] == BEGUN


def test_a_fit_leaves_the_start_free_in_every_trial():
    """Trials that began on three branches give the force that made them; said starts are kept."""
    begun = [0.0, 0.9, 0.4]
    measured = [Plant(AT_ZERO).simulate(pulled(one), seed=i) for i, one in enumerate(begun)]
    unsaid = [Trial(each.time, each.commands, each.measurements) for each in measured]
    start = AT_ZERO.replace({"hysteresis.force_n": 12.0})
    free = ("hysteresis.force_n", "hysteresis.distance_mm")
    free_starts = fitted(start, unsaid, free)
    said = fitted(start, measured, free)
    for each in (free_starts, said):
        assert each.estimate("hysteresis.force_n")[0] == pytest.approx(FORCE, abs=0.3)
        assert each.estimate("hysteresis.distance_mm")[0] == pytest.approx(DISTANCE, abs=0.05)
    # Held at 0, all three, it finds something else: the starts matter.
    held = fitted(
        start,
        [Trial(e.time, e.commands, e.measurements, memory_at_start=0.0) for e in unsaid],
        free,
    )
    assert held.chi_square > 1.2 * free_starts.chi_square
