"""Fits find the parameters that trials were simulated with, as surely as they say."""

import math

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pma_gym.codegen.threads.thread_pool import linear_algebra_alone
from pma_gym.data import calibration
from pma_gym.data.trial import Trial
from pma_gym.discovery import diagnose
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.discovery.fitting.free_parameters import FreeParameters
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.estimation import simulated_trials
from pma_gym.estimation.least_squares import inverse, least
from pma_gym.plant import sensors
from pma_gym.plant.equilibrium import solver
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import vector
from pma_gym.plant.simulation import Run, simulate_all
from tests.discovery.laboratory import fitted

FREE = (
    "sarosi_force.slope_n_per_bar",
    "symmetric_damping.slope_n_s_per_mm_per_kpa",
    "hysteresis.force_n",
    "regulator_lag.time_constant_s",
)
STATION = load_model("station")
TRUE = {
    f"{effect}.{file_key}": value
    for effect in STATION.parameters
    for file_key, value in STATION.values_in_files(effect).items()
    if f"{effect}.{file_key}" in FREE
}
TRUE = {path: TRUE[path] for path in FREE}
OFF = STATION.replace(
    {path: share * TRUE[path] for path, share in zip(FREE, (1.2, 0.75, 1.3, 0.8), strict=True)}
)


def trials(plant, count=6, seconds=3.0, **options):
    """Sines and ramps of load and pressure."""
    when = np.arange(round(384 * seconds)) / 384.0
    line, made = plant.model.parameters["regulator_line"], []
    for i in range(count):
        wave = np.sin(2.0 * np.pi * (0.3 + 0.2 * i) * when)
        pressure = (200e3 + 50e3 * (i % 4)) + 30e3 * np.roll(wave, 7 * i) + 40e3 * when / seconds
        commands = {
            "motor_voltage": 1.5 + 0.2 * i + 0.8 * wave,
            "regulator_voltage": (pressure - line.offset) / line.gain,
        }
        made.append(plant.simulate(Trial(when, commands), seed=i, **options))
    return made


@pytest.fixture(scope="module")
def measured():
    return trials(Plant("station"))


@pytest.fixture(scope="module")
def best(measured):
    return fitted(OFF, measured, FREE)


def test_a_fit_that_ran_out_of_rounds_goes_on_until_it_converges(best, measured, monkeypatch):
    monkeypatch.setattr("pma_gym.discovery.fitting.fit_problem.ROUNDS", 2)
    own = FreeParameters(FREE, np.full(len(FREE), np.inf))
    problem = FitProblem(measured, OFF, own, tuple(map(white_noise, sensors.deviations(OFF))))
    short = problem.fit(OFF)
    assert not short.converged and short.chi_square > best.chi_square + 100.0
    whole = problem.until_converged(short)
    assert whole.chi_square < best.chi_square + 4.0
    assert np.all(np.abs(whole.values - best.values) < np.sqrt(np.diag(best.covariance)))


def test_a_fit_recovers_the_parameters_within_their_standard_errors(best, measured):
    assert best.converged
    assert best.chi_square == pytest.approx(6 * 1152 * 4, rel=6.0 * math.sqrt(2.0 / (6 * 1152 * 4)))
    off = best.values - np.array([TRUE[path] for path in FREE])
    errors = np.sqrt(np.diag(best.covariance))
    assert np.all(np.abs(off) < 3.0 * errors)
    # All together: chi-square of four.
    assert off @ np.linalg.solve(best.covariance, off) < 15.0
    for path, error, share in zip(FREE, errors, (1e-3, 2e-2, 5e-2, 1e-2), strict=True):
        assert 0.0 < error < share * TRUE[path]


def test_errors_cover_what_noise_does_to_the_parameters():
    plant, free = Plant("station"), FREE[:1] + FREE[3:]
    truth, shares = np.array([TRUE[path] for path in free]), []
    when = np.arange(400) / 384.0
    wave = np.sin(3.0 * when)
    for seed in range(40):
        commands = {"motor_voltage": 2.0 + wave, "regulator_voltage": 5.0 + wave}
        one = fitted(plant.model, [plant.simulate(Trial(when, commands), seed=seed)], free)
        shares.append((one.values - truth) / np.sqrt(np.diag(one.covariance)))
    spread = np.std(shares, axis=0)
    assert np.all((spread > 0.7) & (spread < 1.35))
    assert np.all(np.abs(np.mean(shares, axis=0)) < 3.5 / math.sqrt(40))


def test_bits_depend_neither_on_threads_nor_on_blocks(best, measured, monkeypatch):
    monkeypatch.setattr(simulated_trials, "MOST_BYTES", 1 << 20)
    monkeypatch.setattr(simulated_trials, "WORTH_A_THREAD", 1)
    again = fitted(OFF, measured, FREE, threads=3)
    np.testing.assert_array_equal(again.values, best.values)
    np.testing.assert_array_equal(again.covariance, best.covariance)


def test_linear_algebra_has_one_thread_in_a_diagnosis_and_its_own_number_after_it():
    def threads():
        blas = [each for each in threadpool_info() if each["user_api"] == "blas"]
        return {each["num_threads"] for each in blas}

    with threadpool_limits(2, user_api="blas"):
        with linear_algebra_alone():
            assert threads() == {1}
        assert threads() == {2}


def test_what_was_not_measured_counts_for_nothing(measured):
    uninformative = []
    for trial in measured:
        load = trial.measurements["load"].copy()
        load[100:200] = np.nan
        # An amplifier at its end says only that the load lies beyond.
        load[300] = calibration.LOAD_CELL.from_volts(calibration.DAQ_LIMIT - calibration.DAQ_STEP)
        kept = {"contraction": trial.measurements["contraction"], "load": load}
        uninformative.append(Trial(trial.time, trial.commands, kept))
    noise = tuple(map(white_noise, sensors.deviations(OFF)))
    some = WhitenedResiduals(OFF, uninformative, FREE, noise, np.full(len(FREE), np.inf))
    assert some.count == 6 * (2 * 1152 - 101)
    columns = some.columns(some.start[None])
    assert columns is not None
    for (left,) in columns:
        assert np.all(left[[1, 3]] == 0.0) and np.all(left[2, 100:200] == 0.0)
        assert left[2, 300] == 0.0
    assert fitted(OFF, uninformative, FREE[:3]).converged


def test_sensors_without_a_lag_are_fitted_too():
    base = load_model("station")
    kept = {n: p for n, p in base.parameters.items() if n not in ("load_cell", "lvdt")}
    bare = Model("bare", "bare", "station", kept)
    made = trials(Plant(bare), 2, 1.0)
    (value,) = (one := fitted(bare.replace({FREE[0]: 300.0}), made, FREE[:1])).values
    assert abs(value - TRUE[FREE[0]]) < 4.0 * math.sqrt(one.covariance[0, 0])


def test_a_bound_holds(measured):
    # Much more friction than there was leaves nothing to hysteresis.
    friction = {"coulomb_friction.static_n": 60.0, "coulomb_friction.dynamic_n": 50.0}
    start = load_model("station").replace(friction | {"hysteresis.force_n": 5.0})
    one = fitted(start, measured[:2], ("hysteresis.force_n", "regulator_lag.time_constant_s"))
    assert one.estimate("hysteresis.force_n")[0] == 0.0
    assert 0.0 < one.estimate("regulator_lag.time_constant_s")[1] < 0.1


def test_what_the_trials_do_not_determine_has_no_error(measured):
    one = fitted(load_model("station"), measured[:1], ("limits.tension_n", FREE[0]))
    value, error = one.estimate("limits.tension_n")
    assert value == load_model("station").parameters["limits"].tension and math.isinf(error)
    assert one.estimate(FREE[0])[1] < 1.0
    alike = np.array([[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    assert np.diag(inverse(alike)).tolist() == [math.inf, math.inf, 0.5]


def test_trials_without_measurements_and_starts_without_rest_are_refused(measured):
    bare = Trial(measured[0].time, measured[0].commands)
    with pytest.raises(ValueError, match="trial 1 has no measurements"):
        diagnose([measured[0], bare], OFF)
    heavy = {"motor_voltage": np.full(9, 10.0), "regulator_voltage": np.full(9, 1.2)}
    trial = Trial(0.1 * np.arange(9), heavy, {"load": np.full(9, 900.0)})
    assert fitted(load_model("serres2008"), [trial], ["drive.gain_n_per_v"]) is None


def test_many_settle_as_one_does():
    random = np.random.default_rng(4)
    for name in ("serres2008", "station", "cascade"):
        plant = Plant(name)
        scaled = [plant.vector.copy() for _ in range(12)]
        motor, regulator = random.uniform(0.0, 4.0, 12), random.uniform(4.0, 9.0, 12)
        models = []
        for i, path in zip(range(12), plant.model.paths(), strict=False):
            effect, _, file_key = path.partition(".")
            value = plant.model.values_in_files(effect)[file_key]
            models.append(plant.model.replace({path: value * (1.0 + 0.01 * i)}))
            scaled[i] = vector(models[i], plant.tolerance)
        states, zeros = solver.equilibria_at(plant, motor, regulator, np.array(scaled))
        for i, model in enumerate(models):
            rest = Plant(model).settle(motor[i], regulator_voltage=regulator[i])
            np.testing.assert_array_equal(states[i], rest.state)
            assert zeros[i] == rest.zero_contraction
    plant = Plant("serres2008")
    states, zeros = solver.equilibria_at(plant, np.array([10.0, 1.0]), np.array([1.2, 7.0]))
    assert np.isnan(states[0, 0]) and np.isfinite(states[1]).all() and np.isfinite(zeros[1])


def test_a_state_that_is_no_number_does_not_hold_up_the_rest():
    plant = Plant("station")
    rest = plant.settle(1.0, 300e3)
    when = np.linspace(0.0, 10.0, 3841)
    motor, regulator = np.full(3841, 1.0), np.full(3841, plant.regulator_voltage(300e3))
    starts = [rest.state, rest.state * np.nan, rest.state, rest.state]
    zero = rest.zero_contraction
    runs = [Run(when, motor, regulator, "foh", plant.table, start, zero) for start in starts]
    assert simulate_all(plant.program, runs) < 20 * 3841
    assert np.isnan(runs[1].states).all() and np.isfinite(runs[0].states).all()


def test_a_matrix_that_lapack_gives_up_on_is_solved_all_the_same(monkeypatch):
    generator = np.random.default_rng(5)
    rows = generator.standard_normal((30, 6))
    curvature, gradient = rows.T @ rows, generator.standard_normal(6)
    room = np.full(6, -1e3), np.full(6, 1e3)
    step, covariance = least(gradient, curvature, 0.0, *room), inverse(curvature)

    def gives_up(matrix):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr(np.linalg, "eigh", gives_up)
    np.testing.assert_allclose(least(gradient, curvature, 0.0, *room), step, rtol=1e-9)
    np.testing.assert_allclose(inverse(curvature), covariance, rtol=1e-9)
    np.testing.assert_allclose(curvature @ step, -gradient, rtol=1e-9)
