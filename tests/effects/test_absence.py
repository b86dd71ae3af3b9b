"""At its neutral value an effect leaves a simulation as it is without the effect.

Rates keep every bit; a trial all but rounding, for a step adds the terms of its sums in the order
in which they are there, and another effect delays some.

Effects at their usual values, many at once: rests, environments, equations.

With an effect the integration stays as exact as without, and nearly as cheap.
"""

from functools import cache

import numpy as np
import pytest

from pma_gym.effects import CATALOGUE
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.model import load_model
from pma_gym.plant.simulation import Run, simulate_all
from tests.integrator.reference import TRIALS

DELAYING_NOTHING = (
    "drive_dead_zone",
    "drive_saturation",
    "torque_ripple",
    "current_imbalance",
    "nonlinear_stiffness",
    "warm_up",
    "load_cell_error",
)
"""Effects for which no sum has another order."""

EVERY = (
    *DELAYING_NOTHING,
    "passive_stretch",
    "regulator_rate_limit",
    "regulator_deadband",
    "lvdt_error",
    "pressure_transducer_error",
    "potentiometer_error",
    "load_dependent_damping",
    "creep",
    "slow_creep",
    "drive_lag",
    "drive_delay",
    "regulator_delay",
    "lvdt_delay",
    "load_cell_delay",
    "bearing_friction",
    "potentiometer_backlash",
    "filling",
)


@cache
def simulated(plant, trial, interpolation):
    start = plant.settle(1.5, 300e3)
    commands = TRIALS[trial](plant, 300e3)
    states, zero = plant.run(
        commands.time, commands.motor, commands.regulator, interpolation, start
    )
    return start, states, plant.observe(states, zero)


@pytest.fixture(scope="module", params=[("demanding", "zoh"), ("random", "zoh"), ("gentle", "foh")])
def case(request, station):
    return request.param, simulated(station, *request.param)


def kept(plant, station):
    return [plant.states.index(name) for name in station.states]


@pytest.mark.parametrize("name", EVERY)
def test_a_neutral_effect_leaves_a_trial(name, case, station, station_with):
    """Every bit where no sum has another order, all but rounding elsewhere."""
    trial, (start, states, truth) = case
    plant, exact = station_with(name, neutral=True), name in DELAYING_NOTHING
    begun, readings, seen = simulated(plant, *trial)
    columns = kept(plant, station)
    np.testing.assert_array_equal(begun.state[columns], start.state)
    limit = 0.0 if exact else 1e-10 * np.abs(states).max(axis=0)
    assert np.all(np.abs(readings[:, columns] - states) <= limit)
    own = [i for i in range(len(plant.states)) if i not in columns]
    assert not (exact and own) and np.all(readings[:, own] == 0.0)
    for output, values in truth.items():
        limit = 0.0 if exact else 1e-9 * np.ptp(values)
        np.testing.assert_allclose(seen[output], values, rtol=0.0, atol=limit, err_msg=output)


def filled(plant, end):
    """States while the pressure is raised from 300 kPa."""
    time = np.arange(0.0, 0.5, 0.01)
    commands = np.where(time > 0.0, *(plant.regulator_voltage(p) for p in (end, 300e3)))
    return plant.run(time, np.full(len(time), 2.0), commands)[0]


@pytest.mark.parametrize("name", EVERY)
def test_an_effect_that_is_there_changes_something(name, station, station_with):
    plant = station_with(name)
    if name == "passive_stretch":
        assert CATALOGUE[name].law(-1e-3, plant.model.parameters[name]) > 30.0
        return
    if name.startswith("regulator_"):
        # A limit of 2000 kPa/s is felt in large steps only.
        end = 550e3 if name == "regulator_rate_limit" else 320e3
        readings, states = (filled(each, end) for each in (plant, station))
    else:
        readings, states = (simulated(each, "random", "zoh")[1] for each in (plant, station))
    change = np.abs(readings[:, kept(plant, station)] - states).max(axis=0)
    assert np.any(change > 1e-3 * np.ptp(states, axis=0))


@pytest.mark.parametrize("name", EVERY)
def test_nothing_moves_at_rest_with_an_effect(name, station_with):
    plant = station_with(name)
    regulator = plant.regulator_voltage(300e3)
    for voltage in (0.0, 0.5, 2.0, 4.5):
        rest = plant.settle(voltage, 300e3)
        rates = plant.derivative(rest.state, voltage, regulator, rest.zero_contraction)
        assert np.all(np.abs(rates) < 1e-5)
        assert rest.state[plant.states.index("pressure")] == pytest.approx(300e3, rel=1e-12)


MANY = (
    *("nonlinear_stiffness", "warm_up", "drive_delay", "regulator_delay", "regulator_deadband"),
    *("bearing_friction", "potentiometer_backlash"),
)


@pytest.fixture(scope="module")
def model():
    usual = {name: CATALOGUE[name].values_in_files(CATALOGUE[name].usual) for name in MANY}
    return load_model("station").with_effects(usual)


def test_many_environments_have_the_bits_of_one(model):
    env, many = PMAEnv(model=model), PMAVectorEnv(3, model=model)
    observation, _ = env.reset(seed=3)
    observations, _ = many.reset(seed=3)
    np.testing.assert_array_equal(observation, observations[0])
    draw = np.random.default_rng(0)
    for _ in range(100):
        action = draw.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        observation, reward, *_ = env.step(action)
        observations, rewards, *_ = many.step(np.stack([action] * 3))
        np.testing.assert_array_equal(observation, observations[0])
        assert reward == rewards[0]


INTEGRATED = (
    "passive_stretch",
    "load_dependent_damping",
    "creep",
    "slow_creep",
    "drive_dead_zone",
    "drive_saturation",
    "drive_lag",
    "drive_delay",
    "regulator_delay",
    "regulator_deadband",
    "nonlinear_stiffness",
    "warm_up",
    "bearing_friction",
    "potentiometer_backlash",
    "torque_ripple",
    "current_imbalance",
    "regulator_rate_limit",
    "filling",
)
PRESSURES = (200e3, 550e3)


def integrated(plant, trial, pressure):
    """States at every command, and attempts at steps."""
    start, commands = plant.settle(0.0, pressure), TRIALS[trial](plant, pressure)
    columns = (commands.time, commands.motor, commands.regulator)
    run = Run(*columns, "zoh", plant.table, start.state, start.zero_contraction)
    attempts = simulate_all(plant.program, [run])
    return run.states, attempts


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize("name", INTEGRATED)
def test_positions_keep_their_limit_with_an_effect(name, trial, station_with, station):
    plant, fine = station_with(name), station_with(name, tolerance=1e-6)
    positions = [plant.states.index(state) for state in ("contraction", "angle")]
    made = plain = 0
    for pressure in PRESSURES:
        ends, attempts = integrated(plant, trial, pressure)
        truth, _ = integrated(fine, trial, pressure)
        error = np.abs(ends - truth)[:, positions].max(axis=0)
        assert np.all(error <= 1e-6 * np.ptp(truth[:, positions], axis=0))
        made, plain = made + attempts, plain + integrated(station, trial, pressure)[1]
    # Nothing bends as sharply as damping whose factor follows a cable that whips.
    assert made <= (2.7 if name == "load_dependent_damping" else 1.6) * plain
