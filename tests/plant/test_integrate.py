"""The integrator: its weights, its order, what it does exactly, and its step size."""

import math

import numpy as np
import pytest

from benchmarks.accuracy import (
    FRICTIONLESS,
    MODELS,
    POSITION_LIMIT,
    STATE_LIMIT,
    energy_drift,
    error_ladder,
    mass_effect,
    one_mass_error,
)
from benchmarks.convergence import orders
from pma_gym.plant.integrate import DEFAULT_STEP_S
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.weights import coefficients


def phi(z):
    """phi_1, phi_2, phi_3 at z = -decay * step: closed forms, series where they would cancel."""
    if abs(z) < 1.0:
        return tuple(
            math.fsum(z**k / math.factorial(k + order) for k in range(30)) for order in (1, 2, 3)
        )
    first = math.expm1(z) / z
    second = (first - 1.0) / z
    return first, second, (second - 0.5) / z


@pytest.mark.parametrize("step", [1.0, 1e-4])
@pytest.mark.parametrize(
    "share", [0.0, 1e-12, 1e-6, 1e-3, 0.03, 0.3, 1.0, 1.7, 5.0, 13.0, 30.0, 60.0, 79.0, 81.0, 1e4]
)
def test_weights_are_the_closed_forms(share, step):
    z = -share
    one, two, three = phi(z)
    expected = [
        math.exp(z / 2.0),
        0.5 * step * phi(z / 2.0)[0],
        math.exp(z),
        step * (one - 3.0 * two + 4.0 * three),
        step * (two - 2.0 * three),
        step * (4.0 * three - two),
    ]
    found = coefficients(share / step, step)
    # Beside the weight of the state itself, 1, and of its rate, the step.
    scale = [1.0, step, 1.0, step, step, step]
    assert np.abs(np.subtract(found, expected) / scale).max() < 3e-15


def test_without_decay_the_weights_are_those_of_classical_runge_kutta():
    assert coefficients(0.0, 0.6) == pytest.approx((1.0, 0.3, 1.0, 0.1, 0.1, 0.1), rel=1e-14)


@pytest.mark.parametrize("share", [0.01, 1.0, 30.0, 500.0])
def test_a_decay_towards_a_constant_is_exact(share):
    _, _, whole, first, middle, last = coefficients(share, 1.0)
    state, target = 3.0, -2.0
    stepped = whole * state + (first + 4.0 * middle + last) * share * target
    assert stepped == pytest.approx(target + (state - target) * math.exp(-share), abs=1e-13)


def test_order_four():
    _, found = orders(0.05, np.array([8e-4, 4e-4, 2e-4, 1e-4]))
    assert np.all(found > 3.9)


def test_order_four_in_the_end_and_never_unstable_with_stiff_damping():
    # B/m = 5800 1/s: times these steps 1.2, 0.6, 0.3. The order rises to 4 as that falls below 1.
    _, found = orders(2.9, np.array([2e-4, 1e-4, 5e-5]))
    assert np.all(found[1] > found[0])
    assert np.all(found[1] > 3.7)
    # 29 000 1/s: 11.6 to 2.9, where a classical step is unstable (beyond 2.8). The order drops to
    # 2, the error stays small: 20 nm of 20 mm at the default step.
    errors, found = orders(14.5, np.array([4e-4, 2e-4, 1e-4]))
    assert np.all(found > 1.9)
    assert errors[2][0] < 2e-8


def test_the_regulator_is_exact():
    plant = Plant("serres2008")
    start = plant.settle(0.0, 200e3)
    when = np.array([0.0, 0.05, 0.1, 0.25, 0.9])
    voltage = plant.regulator_voltage(400e3)
    states, _ = plant.run(when, np.zeros(5), np.full(5, voltage), condition=start)
    pressure = states[:, plant.states.index("pressure")]
    np.testing.assert_allclose(pressure, 400e3 - 200e3 * np.exp(-when / 0.1), rtol=1e-11)


def test_each_sensor_lags_by_the_analytic_first_order():
    plant = Plant("serres2008")
    start = plant.settle(0.0, 200e3)
    lag = plant.states.index("lag_pressure_transducer")
    when = np.linspace(0.0, 0.2, 41)
    states, _ = plant.run(
        when, np.zeros(41), np.full(41, plant.regulator_voltage(300e3)), condition=start
    )
    slow, fast = 10.0, 2.0 * math.pi * 50.0
    response = 1.0 - (fast * np.exp(-slow * when) - slow * np.exp(-fast * when)) / (fast - slow)
    # The lag follows an exponential, not a constant: order 4 here, 1e-9 of 100 kPa.
    np.testing.assert_allclose(states[:, lag], 200e3 + 100e3 * response, atol=1e-4)


@pytest.mark.parametrize("model", MODELS)
def test_the_default_step_against_scipy_on_demanding_trials(model):
    (error,) = error_ladder(model, (DEFAULT_STEP_S,))
    assert error.states[error.worst_state] < STATE_LIMIT
    assert error.position < POSITION_LIMIT


def test_energy_stays_where_nothing_dissipates():
    coarse, fine = energy_drift(DEFAULT_STEP_S, 0.5), energy_drift(1e-5, 0.5)
    assert coarse < 1e-6
    assert fine < 1e-8


def test_friction_and_damping_only_ever_take_energy():
    damped = {"damping.contracting_n_s_per_mm": 0.05, "coulomb_friction.static_n": 1.96}
    damped |= {"coulomb_friction.dynamic_n": 1.47}
    plant = Plant(load_model("serres2008").replace(FRICTIONLESS | damped))
    start, count = plant.settle(3.0, 300e3), 400
    constant = np.ones(count)
    states, zero = plant.run(
        1e-3 * np.arange(count),
        4.0 * constant,
        plant.regulator_voltage(300e3) * constant,
        condition=start,
    )
    from benchmarks.accuracy import energies

    _, total = energies(plant, states, zero, 4.0)
    # The bristle stores at most half of its force times its presliding.
    assert np.all(np.diff(total) < 1e-5)
    assert total[-1] < total[0] - 0.01


def test_a_stiff_cable_makes_one_mass_of_two():
    errors = [one_mass_error(stiffness, 0.05) for stiffness in (1e4, 1e5, 1e6)]
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.2)
    assert errors[2] < 1e-7


def test_a_step_too_large_for_the_cable_is_warned_of():
    stiff = load_model("serres2008").replace({"cable.stiffness_n_per_mm": 1e5})
    with pytest.warns(UserWarning, match=r"swings at 1\.52e\+04 rad/s, .* at most 7e-06"):
        Plant(stiff, compiled=False)
    Plant(stiff, step=1e-5, compiled=False)


def test_figure_16_the_moving_mass_changes_the_contraction_by_under_one_percent():
    assert 0.0005 < mass_effect(0.5) < 0.01
    # The mass only delays by m / B: the effect is proportional to it.
    assert mass_effect(0.5) / mass_effect(0.25) == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("model", ["station", "cascade"])
def test_samples_lie_on_the_trajectory(model):
    plant = Plant(model)
    start = plant.settle(3.0, 300e3)
    regulator = plant.regulator_voltage(320e3)
    period = 1.0 / 384.0
    samples = np.full((40, len(plant.states)), np.nan)
    moved = plant.settle(3.0, 300e3)
    for _ in range(10):
        plant.step(moved, 3.3, regulator, 0.01, period, samples)
    when = np.append(np.arange(39) * period, 0.1)
    states, _ = plant.run(
        when, np.full(40, 3.3), np.full(40, regulator), condition=start, joined=False
    )
    assert np.isnan(samples[39]).all()
    span = np.ptp(states, axis=0)
    assert np.abs((samples[:39] - states[:39]) / span).max() < 2e-4
    np.testing.assert_array_equal(samples[0], start.state)
    assert np.abs((moved.state - states[39]) / span).max() < 1e-5
    assert moved.time == pytest.approx(0.1)


def test_run_steps_as_step_does():
    plant = Plant("station")
    when = 0.01 * np.arange(31)
    motor = 2.0 + np.sin(when)
    regulator = plant.regulator_voltage(350e3)
    states, _ = plant.run(when, motor, np.full(31, regulator), joined=False)
    condition = plant.settle(float(motor[0]), regulator_voltage=regulator)
    for row, voltage in enumerate(motor[:-1]):
        np.testing.assert_array_equal(states[row], condition.state)
        duration = when[row + 1] - when[row]
        plant.step(condition, voltage, regulator, duration)
    np.testing.assert_array_equal(states[-1], condition.state)


def test_joined_commands_pass_through_their_middle():
    plant = Plant("serres2008")
    start = plant.settle(1.0, 300e3)
    regulator = plant.regulator_voltage(300e3)
    ends, _ = plant.run(np.array([0.0, 0.4]), np.array([1.0, 5.0]), np.full(2, regulator))
    middle, _ = plant.run(
        np.array([0.0, 0.1, 0.4]), np.array([1.0, 2.0, 5.0]), np.full(3, regulator)
    )
    held, _ = plant.run(np.array([0.0, 0.4]), np.array([1.0, 5.0]), np.full(2, regulator), False)
    np.testing.assert_allclose(ends[-1], middle[-1], rtol=1e-6, atol=1e-9)
    # The drive held at its first voltage moves nothing.
    np.testing.assert_allclose(held[-1], start.state, rtol=1e-9, atol=1e-7)
