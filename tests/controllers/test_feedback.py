"""The PID against analytic responses, at its limits, and on the station.

Preview MPC: its quadratic program, its limits, its bits, and what it reaches on the station.
"""

import math
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

from controllers import CONTROLLERS, PID, FeedforwardPID, PreviewMPC
from controllers.design.designs import Gains, scheduled_gains
from controllers.design.quadratic_program import ACCURACY, BoundedProgram, imported_osqp
from controllers.models.voltage import nominal_offset
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.tasks import EVERY_TASK, isotonic

PERIOD = 0.01


def begun(gains, station, reference=lambda time: 0.0, period=PERIOD):
    controller = PID(gains)
    controller.reset(reference, station(period=period))
    return controller


@pytest.mark.parametrize("name", ["pid", "feedforward_pid", "lqg", "adrc", "ppo"])
def test_settings_of_another_plant_are_said_to_be(name):
    env = PMAEnv("displacement", pressure_kpa=300)
    env.reset(seed=1)
    for model in ("station", "serres2008"):
        CONTROLLERS[name]().reset(env.reference, replace(env.station, model=load_model(model)))
    light = load_model("station").replace({"rotor.inertia_kg_m2": 1e-5}, name="light")
    with pytest.warns(UserWarning, match="model station; a volt of the motor .*light 6.8 times"):
        CONTROLLERS[name]().reset(env.reference, replace(env.station, model=light))


def test_a_heavy_load_that_hangs_is_another_plant_to_the_regulator():
    hanging = load_model("station").with_effects({"hanging_load": {"share": 1.0}})
    for load, warned in ((10.0, False), (400.0, True)):
        env = PMAEnv(isotonic(load), model=hanging, pressure_kpa=300)
        env.reset(seed=1)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            PID().reset(env.reference, env.station)
        assert [str(one.message)[:15] for one in caught] == ["the gains of pi"] * warned


def close(controller, pole, gain, steps, reading, period=PERIOD, offset=0.0):
    """Extension (m) of y[k+1] = pole y[k] + (1 - pole) gain (u[k] - offset) under control."""
    position = [0.0]
    for k in range(steps):
        voltage = controller.act(reading(extension=position[-1]), k * period)
        position.append(pole * position[-1] + (1.0 - pole) * gain * (voltage - offset))
    return np.array(position)


def test_proportional_control_of_a_first_order_plant(station, reading):
    # Closed: y[k+1] = q y[k] + (pole's share) g k_p r, q = pole - (1 - pole) g k_p.
    pole, gain, proportional, wanted = 0.9, 4e-3, 500.0, 1e-3
    gains = Gains(proportional, 0.0, 0.0, 0.005)
    controller = begun(gains, station, lambda time: wanted)
    offset = nominal_offset(station())
    got = close(controller, pole, gain, 40, reading, offset=offset)
    loop = gain * proportional
    q = pole - (1.0 - pole) * loop
    analytic = wanted * loop / (1.0 + loop) * (1.0 - q ** np.arange(41))
    assert got == pytest.approx(analytic, abs=1e-15)


def test_pi_that_cancels_the_pole_leaves_a_first_order_loop(station, reading):
    # k_p / k_i = tau: y = r (1 - exp(-t / lambda)), lambda = tau / (g k_p).
    period, lag, gain, wanted, closed = 1e-4, 0.05, 4e-3, 1e-3, 0.02
    proportional = lag / (gain * closed)
    gains = Gains(proportional, proportional / lag, 0.0, 0.005)
    controller = begun(gains, station, lambda time: wanted, period)
    got = close(
        controller, math.exp(-period / lag), gain, 1000, reading, period, nominal_offset(station())
    )
    times = period * np.arange(1001)
    assert got == pytest.approx(wanted * (1.0 - np.exp(-times / closed)), abs=0.005 * wanted)


@pytest.mark.parametrize("lead", [0.0, 1.0 / (4e-3 * 6000.0)])
def test_ramp_error_is_the_voltages_slope_over_the_integral_gain_less_the_lead(
    lead, station, reading
):
    pole, gain, speed = 0.9, 4e-3, 5e-3
    gains = Gains(300.0, 6000.0, 0.0, 0.005, lead=lead)
    controller = begun(gains, station, lambda time: speed * time)
    got = close(controller, pole, gain, 500, reading, offset=nominal_offset(station()))
    left = speed * (1.0 / (gain * 6000.0) - lead)
    assert speed * 5.0 - got[-1] == pytest.approx(left, rel=1e-6, abs=1e-6 * speed)


def test_derivative_is_filtered(station, reading):
    # A ramp of the error: D = k_d e' (1 - share^k), share = tau_f / (tau_f + T).
    gains = Gains(0.0, 0.0, 2.0, 0.03)
    controller = begun(gains, station, lambda time: 0.1 * time)
    offset = nominal_offset(station())
    got = [controller.act(reading(), k * PERIOD) - offset for k in range(20)]
    share = 0.03 / (0.03 + PERIOD)
    assert got == pytest.approx(2.0 * 0.1 * (1.0 - share ** np.arange(20)), abs=1e-12)


def test_first_step_has_no_bump(station, reading):
    # The drive of the station begins to pull at 2.0 N / 97.84 N/V.
    controller = PID()
    controller.reset(lambda time: 0.0, station())
    assert controller.act(reading(), 0.0) == pytest.approx(2.0 / 97.84, abs=1e-3)
    controller = FeedforwardPID()
    controller.reset(lambda time: 5e-3 * time, station())
    assert controller.act(reading(), 0.0) == controller.feedforward(0.0)


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_anti_windup_recovers(direction, station, reading):
    """3 s at a limit, then a small error the other way: the voltage leaves the limit at once.

    Wound up, the integral would hold 240 V and give back 8 V/s.
    """
    gains = Gains(400.0, 8000.0, 0.0, 0.005)
    controller = begun(gains, station, lambda time: direction * 10e-3 if time < 3.0 else 0.0)
    limit = 10.0 if direction > 0.0 else 0.0
    held = [controller.act(reading(), k * PERIOD) for k in range(300)]
    assert held[100:] == [limit] * 200
    back = reading(extension=direction * 1e-3)
    after = [controller.act(back, (300 + k) * PERIOD) for k in range(10)]
    assert all(voltage != limit for voltage in after)


def test_gains_grow_towards_the_end_of_the_range():
    gains = Gains(100.0, 10.0, 1.0, 0.005, end_factor=3.0)
    assert gains.scaled(0.0) == gains._replace(end_factor=1.0)
    assert gains.scaled(0.5).proportional == pytest.approx(150.0)
    assert gains.scaled(1.0).integral == pytest.approx(30.0)
    assert gains.scaled(1.3).derivative == pytest.approx(3.0)


def test_gains_are_low_where_the_cable_may_be_slack():
    gains = Gains(100.0, 10.0, 1.0, 0.005, start_factor=0.25)
    assert gains.scaled(0.0)[:3] == pytest.approx((25.0, 5.0, 0.25))
    assert gains.scaled(0.1).proportional == pytest.approx(62.5)
    assert gains.scaled(0.2) == gains.scaled(1.0) == gains._replace(start_factor=1.0)


def test_gains_are_linear_in_pressure(station):
    low, middle, high = (
        scheduled_gains("pid", station("displacement", p)) for p in (200.0, 225.0, 250.0)
    )
    assert middle == pytest.approx(0.5 * (np.array(low) + np.array(high)))


def test_a_model_of_one_s_own_gets_the_gains_of_its_plant(station):
    for name in ("station", "cascade"):
        own = load_model(name).replace({}, name="mine")
        where = station("rotation", 400, model=own)
        known = station("rotation", 400, model=name)
        assert scheduled_gains("pid", where) == scheduled_gains("pid", known)


@pytest.mark.parametrize("controller", ["pid", "feedforward_pid"])
def test_gains_are_of_the_kind_of_task_and_of_the_loop(controller, station):
    base = station("displacement", 300.0)
    sine = replace(base, task=EVERY_TASK["displacement_sine"])
    assert scheduled_gains(controller, sine) == scheduled_gains(controller, base)
    late = replace(base, period=0.02, action_delay=0.02)
    slow = scheduled_gains(controller, late)
    assert slow.integral < 0.7 * scheduled_gains(controller, base).integral
    # A delay of the measurement counts as one of the command does.
    delayed = replace(base, period=0.02, observation_delay=0.02)
    assert scheduled_gains(controller, delayed) == slow
    # What was not tuned takes the gains of what is nearest in dead time: 5 to 10 ms, 50 to 40 ms.
    quick = replace(base, period=0.005)
    assert scheduled_gains(controller, quick) == scheduled_gains(controller, base)
    assert scheduled_gains(controller, replace(late, action_delay=0.03)) == slow
    triangle = replace(base, task=EVERY_TASK["triangle_low"], pressure=150e3)
    isotonic = replace(triangle, task=EVERY_TASK["isotonic"])
    assert scheduled_gains(controller, triangle) == scheduled_gains(controller, isotonic)


def test_a_reading_is_compared_with_the_reference_of_its_time(station, reading):
    late = replace(station(), observation_delay=0.02)
    controller = PID(Gains(400.0, 8000.0, 0.0, 0.005))
    controller.reset(lambda time: 5e-3 * time, late)
    for k in range(2, 50):
        delayed = reading(extension=5e-3 * (k * PERIOD - 0.02))
        assert controller.act(delayed, k * PERIOD) == pytest.approx(nominal_offset(late), abs=1e-9)


def test_regulator_begins_at_the_voltage_that_holds_its_pressure(station, reading):
    held = replace(station(pressure_kpa=200.0), task=EVERY_TASK["isotonic"])
    controller = PID()
    controller.reset(lambda time: 0.0, held)
    # 59.672 kPa/V, -19.578 kPa.
    assert controller.act(reading(), 0.0) == pytest.approx((200.0 + 19.578) / 59.672)
    # A muscle that is shorter by 1 mm than wanted has its pressure lowered.
    assert controller.act(reading(extension=-1e-3), PERIOD) < controller.act(reading(), 0.0)


def test_missing_gains_say_how_to_tune_them(station, tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text("schema = 3\n")
    with pytest.raises(ValueError, match=r"no gains of pid for the rotation task.*tune --model"):
        scheduled_gains("pid", station("rotation"), path)
    path = tmp_path / "old.toml"
    path.write_text("schema = 0\n")
    with pytest.raises(ValueError, match=r"must have schema 3, got 0; write it anew"):
        scheduled_gains("pid", station("rotation"), path)


def problem(seed, count=6):
    generator = np.random.default_rng(seed)
    rows = generator.normal(size=(2 * count, count))
    return rows.T @ rows, generator.normal(size=count)


@pytest.mark.parametrize("seed", range(5))
def test_without_limits_the_program_solves_the_normal_equations(seed):
    square, linear = problem(seed)
    program = BoundedProgram(6)
    solution = program.solve(square, linear, np.full(6, -1e6), np.full(6, 1e6))
    assert np.allclose(square @ solution, -linear, rtol=0, atol=1e-10)
    assert program.limited == 0


@pytest.mark.parametrize("seed", range(5))
def test_at_limits_the_program_keeps_the_optimality_conditions(seed):
    square, linear = problem(seed)
    program = BoundedProgram(6)
    low, high = np.full(6, -0.05), np.full(6, 0.02)
    solution = program.solve(square, linear, low, high)
    slope = square @ solution + linear
    assert program.limited == 1 and program.failures == 0
    assert np.all((low <= solution) & (solution <= high))
    near = 100.0 * ACCURACY
    # At a limit the slope pushes against it, elsewhere there is none (Karush, Kuhn, Tucker).
    assert np.all(slope[solution <= low + near] >= -near * np.abs(square).max())
    assert np.all(slope[solution >= high - near] <= near * np.abs(square).max())
    inside = (solution > low + near) & (solution < high - near)
    assert np.abs(slope[inside]).max(initial=0.0) < near * np.abs(square).max()


def test_the_plan_is_the_least_squares_solution_of_the_stepped_model(station):
    """Error and changes of voltage stacked, the error found by stepping the filters' own model."""
    controller = PreviewMPC()
    controller.reset(lambda time: 5e-3 * time, station())
    design, bank = controller._design, controller._bank
    first, count = 200, controller._count
    generator = np.random.default_rng(0)
    start = 1e-3 * generator.normal(size=bank.estimates.shape) * (design.sensors[0] != 0.0)
    weights, nominal = bank.weights, design.motion.volts

    def errors(plan):
        x, residuals = start, []
        for k, volts in enumerate(plan):
            x = bank.moved(x, first + k, nominal[first + k] + volts)
            predicted = x @ design.ahead[0, first, 0]
            residuals.append(design.motion.error[first + k + 1] + weights @ predicted)
        return np.array(residuals)

    free = errors(np.zeros(count))
    effect = np.stack([errors(1e-3 * pulse) - free for pulse in np.eye(count)], axis=1) / 1e-3
    scale = np.sqrt(np.mean(np.sum(effect**2, axis=0)))
    effort = np.sqrt(controller.settings.effort)
    changes = np.eye(count) - np.eye(count, k=-1)
    rows = np.vstack([effect / scale, effort * changes])
    wanted, *_ = np.linalg.lstsq(rows, np.append(-free / scale, np.zeros(count)))
    square, linear = controller._problem(first, start, weights)
    plan = controller.program.solve(square, linear, np.full(count, -1e6), np.full(count, 1e6))
    assert np.abs(wanted).max() > 1e-3
    assert plan == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())


def test_voltages_keep_their_limits_whatever_the_sensors_say(station, reading):
    generator = np.random.default_rng(1)
    controller = PreviewMPC()
    controller.reset(lambda time: 5e-3 * time, station())
    for k in range(120):
        noisy = reading(extension=float(generator.normal(0.0, 0.03)), time=0.01 * k)
        assert 0.0 <= controller.act(noisy, 0.01 * k) <= 10.0
    assert controller.program.limited > 0 and controller.program.failures == 0


def test_a_missing_osqp_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "osqp", None)
    with pytest.raises(ImportError, match=r"needs osqp.*pip install pma-gym\[mpc\]"):
        imported_osqp()
