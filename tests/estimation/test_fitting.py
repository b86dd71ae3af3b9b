"""Fits find the parameters that trials were simulated with; differences are derivatives."""

import math

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pma_gym.data import calibration
from pma_gym.data.trial import Trial
from pma_gym.estimation import fitting, simulated_trials
from pma_gym.estimation.fitting import fit
from pma_gym.estimation.least_squares import inverse, least
from pma_gym.estimation.residuals import Residuals
from pma_gym.plant.equilibrium import solver
from pma_gym.plant.model import Model, ModelError, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import vector
from pma_gym.plant.simulation import Run, simulate_all
from tests.discovery.test_joint import joint

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
TRUE_SI = {
    "sarosi_force.slope": STATION.parameters["sarosi_force"].slope,
    "symmetric_damping.slope": STATION.parameters["symmetric_damping"].slope,
    "hysteresis.force": STATION.parameters["hysteresis"].force,
    "regulator_lag.time_constant": STATION.parameters["regulator_lag"].time_constant,
}
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
def fitted(measured):
    return fit(OFF, measured, FREE)


def test_a_fit_recovers_the_parameters_within_their_standard_errors(fitted, measured):
    assert fitted.converged and fitted.at_bounds == ()
    assert fitted.count == 6 * 1152 * 4
    assert fitted.reduced_chi_square == pytest.approx(1.0, abs=6.0 * math.sqrt(2.0 / fitted.count))
    off = np.array([fitted.values[path] - TRUE[path] for path in FREE])
    assert np.all(np.abs(off) < 3.0 * np.array([fitted.errors[path] for path in FREE]))
    # All together: chi-square of four.
    off = np.array([value - TRUE_SI[name] for name, value in fitted.parameters.items()])
    assert off @ np.linalg.solve(fitted.covariance, off) < 15.0
    for path, share in zip(FREE, (1e-3, 2e-2, 5e-2, 1e-2), strict=True):
        assert 0.0 < fitted.errors[path] < share * TRUE[path]
    again = Residuals(fitted.model, measured, FREE).each(np.array(list(fitted.values.values())))
    assert sum(np.sum(each**2) for each in again) == pytest.approx(fitted.chi_square, rel=1e-12)


def test_parameters_and_their_covariance_are_in_si_in_one_order(fitted):
    assert list(fitted.parameters) == list(TRUE_SI)
    for name, value in fitted.parameters.items():
        effect, _, parameter = name.partition(".")
        assert value == pytest.approx(
            getattr(fitted.model.parameters[effect], parameter), rel=1e-12
        )
    factors = np.array([1e-5, 1.0, 1.0, 1.0])  # SI of N/bar, N s/mm/kPa, N, s
    errors = factors * np.array([fitted.errors[path] for path in FREE])
    np.testing.assert_allclose(np.sqrt(np.diag(fitted.covariance)), errors, rtol=1e-12)


def test_errors_cover_what_noise_does_to_the_parameters():
    plant, free = Plant("station"), FREE[:1] + FREE[3:]
    truth, shares = np.array([TRUE[path] for path in free]), []
    when = np.arange(400) / 384.0
    wave = np.sin(3.0 * when)
    for seed in range(40):
        commands = {"motor_voltage": 2.0 + wave, "regulator_voltage": 5.0 + wave}
        fitted = fit(plant.model, [plant.simulate(Trial(when, commands), seed=seed)], free)
        errors = np.array(list(fitted.errors.values()))
        shares.append((np.array(list(fitted.values.values())) - truth) / errors)
    spread = np.std(shares, axis=0)
    assert np.all((spread > 0.7) & (spread < 1.35))
    assert np.all(np.abs(np.mean(shares, axis=0)) < 3.5 / math.sqrt(40))


@pytest.mark.parametrize("central", [False, True])
def test_the_jacobian_is_that_of_a_tight_tolerance(measured, central):
    values = np.array(list(TRUE.values()))
    loose = Residuals(OFF, measured[:3], FREE)
    tight = Residuals(OFF, measured[:3], FREE, tolerance=1e-8)
    curvature = loose.sums(values, 1e-3 * values).curvature
    moves = fitting.SHOWN / np.sqrt(np.diag(curvature) / loose.count)
    slopes = np.concatenate([j.reshape(4, -1) for j in loose.jacobian(values, moves, central)], 1)
    truth = np.concatenate([j.reshape(4, -1) for j in tight.jacobian(values, 0.1 * moves, True)], 1)
    size = np.linalg.norm(truth, axis=1)
    assert np.all(np.linalg.norm(slopes - truth, axis=1) < 0.02 * size)
    assert np.all(np.sum(slopes * truth, axis=1) / size / np.linalg.norm(slopes, axis=1) > 0.9998)


@pytest.mark.parametrize("central", [False, True])
def test_sums_are_those_of_residuals_and_their_derivatives(measured, central):
    some = Residuals(OFF, measured[:3], FREE)
    values, moves = some.start, 1e-3 * some.start
    sums = some.sums(values, moves, central)
    r = np.concatenate([residuals.ravel() for residuals in some.each(values)])
    j = np.concatenate(
        [slopes.reshape(4, -1) for slopes in some.jacobian(values, moves, central)], axis=1
    )
    assert sums.chi_square == pytest.approx(r @ r, rel=1e-12)
    np.testing.assert_allclose(sums.gradient, j @ r, rtol=1e-9)
    np.testing.assert_allclose(sums.curvature, j @ j.T, rtol=1e-9)


def test_bits_depend_neither_on_threads_nor_on_blocks(fitted, measured, monkeypatch):
    estimate = fit(OFF, measured, FREE, threads=3)
    assert estimate.values == fitted.values and estimate.chi_square == fitted.chi_square
    np.testing.assert_array_equal(estimate.covariance, fitted.covariance)
    monkeypatch.setattr(simulated_trials, "MOST_BYTES", 1 << 20)
    assert fit(OFF, measured, FREE, threads=2).values == fitted.values


def test_linear_algebra_has_one_thread_in_a_fit_and_its_own_number_after_it(measured):
    def threads(_=None):
        numbers = [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]
        seen.extend(numbers)
        return numbers

    seen = []
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        seen.clear()
        fit(OFF, measured[:1], FREE[:1], progress=threads)
        assert seen and set(seen) == {1}
        assert threads() == before and set(before) == {2}


def test_many_trials_are_fitted_to_a_few_of_them_first():
    rounds = []
    data = fit(OFF, trials(Plant("station"), 16, 1.0), FREE, progress=rounds.append)
    assert data.converged
    assert {entry.trials for entry in rounds} == {fitting.FEW, 16}
    assert [entry.number for entry in rounds] == sorted(entry.number for entry in rounds)
    assert set(rounds[0].values) == set(FREE)
    for path in FREE:
        assert abs(data.values[path] - TRUE[path]) < 4.0 * data.errors[path]


def test_what_was_not_measured_counts_for_nothing(fitted, measured):
    uninformative = []
    for trial in measured:
        load = trial.measurements["load"].copy()
        load[100:200] = np.nan
        # An amplifier at its end says only that the load lies beyond.
        load[300] = calibration.LOAD_CELL.from_volts(calibration.DAQ_LIMIT - calibration.DAQ_STEP)
        kept = {"contraction": trial.measurements["contraction"], "load": load}
        uninformative.append(Trial(trial.time, trial.commands, kept))
    some = Residuals(OFF, uninformative, FREE)
    assert some.count == 6 * (2 * 1152 - 101)
    for estimate in some.each(some.start):
        assert np.all(estimate[:, [1, 3]] == 0.0) and np.all(estimate[100:200, 2] == 0.0)
        assert estimate[300, 2] == 0.0
    estimate = fit(OFF, uninformative, FREE[:3])
    assert estimate.converged


def test_sensors_without_a_lag_are_fitted_too():
    base = load_model("station")
    kept = {n: p for n, p in base.parameters.items() if n not in ("load_cell", "lvdt")}
    bare = Model("bare", "bare", "station", kept)
    made = trials(Plant(bare), 2, 1.0)
    fitted = fit(bare.replace({FREE[0]: 300.0}), made, FREE[:1])
    assert abs(fitted.values[FREE[0]] - TRUE[FREE[0]]) < 4.0 * fitted.errors[FREE[0]]


def test_a_bound_holds(measured):
    # Much more friction than there was leaves nothing to hysteresis.
    friction = {"coulomb_friction.static_n": 60.0, "coulomb_friction.dynamic_n": 50.0}
    start = load_model("station").replace(friction | {"hysteresis.force_n": 5.0})
    fitted = fit(start, measured[:2], ("hysteresis.force_n", "regulator_lag.time_constant_s"))
    assert fitted.at_bounds == ("hysteresis.force_n",) and fitted.converged
    assert fitted.values["hysteresis.force_n"] == 0.0
    assert math.isnan(fitted.errors["hysteresis.force_n"])
    assert 0.0 < fitted.errors["regulator_lag.time_constant_s"] < 0.1


def test_what_the_trials_do_not_determine_has_no_error(measured):
    fitted = fit(load_model("station"), measured[:1], ("limits.tension_n", FREE[0]))
    assert fitted.values["limits.tension_n"] == load_model("station").parameters["limits"].tension
    assert math.isinf(fitted.errors["limits.tension_n"]) and fitted.errors[FREE[0]] < 1.0
    alike = np.array([[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    assert np.diag(inverse(alike)).tolist() == [math.inf, math.inf, 0.5]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("sarosi_force.slope", "did you mean sarosi_force.slope_n_per_bar"),
        ("lvdt.noise_mm", "it is what residuals are counted in"),
    ],
)
def test_what_cannot_be_fitted_is_refused(measured, path, message):
    with pytest.raises(ModelError, match=message):
        fit(OFF, measured, [path])


def test_trials_without_measurements_and_starts_without_rest_are_refused(measured):
    with pytest.raises(ValueError, match="at least one trial"):
        fit(OFF, [], FREE)
    bare = Trial(measured[0].time, measured[0].commands)
    with pytest.raises(ValueError, match="trial 1 has no measurements"):
        fit(OFF, [measured[0], bare], FREE)
    heavy = {"motor_voltage": np.full(9, 10.0), "regulator_voltage": np.full(9, 1.2)}
    trial = Trial(0.1 * np.arange(9), heavy, {"load": np.full(9, 900.0)})
    with pytest.raises(ValueError, match="cannot be simulated where the fit begins"):
        fit(load_model("serres2008"), [trial], ["drive.gain_n_per_v"])


def test_a_callback_ends_a_fit(measured):
    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(OFF, measured, FREE, threads=2, progress=stop)


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


@pytest.mark.parametrize(("size", "begun"), [(1e3, 0.001), (1.0, 0.02), (1e-4, -0.05)])
def test_an_effect_of_a_small_joint_is_fitted_as_that_of_a_large_one(size, begun):
    """A step of the range that the catalogue allows its damping would run away."""
    tables = {"joint_directional_damping": {"difference_n_m_s": 0.004 * size}}
    hidden = joint(0.02 * size, joint_damping={"coefficient_n_m_s": 0.08 * size}, **tables)
    time = np.arange(0.0, 2.0, 0.01)
    torque = 0.1 * size * np.sin(2.0 * np.pi * time)
    log = Plant(hidden).simulate(Trial(time, {"torque_command": torque}), seed=1)
    wrong = hidden.replace({"joint_directional_damping.difference_n_m_s": begun * size})
    path = "joint_directional_damping.difference_n_m_s"
    result = fit(wrong, [log], [path])
    (low, high) = 0.0035 * size, 0.0045 * size
    assert low < result.parameters["joint_directional_damping.difference"] < high
    assert result.converged
