"""Preview MPC: its quadratic program, its limits, its bits, and what it reaches on the station."""

import sys

import numpy as np
import pytest

from controllers import PreviewMPC
from controllers.design.quadratic_program import ACCURACY, BoundedProgram, imported_osqp


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
