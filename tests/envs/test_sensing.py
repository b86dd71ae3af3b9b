"""What the agent sees: the observation's table, the sensors' noise, zeros and history."""

import numpy as np
import pytest

from pma_gym.data import calibration
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.options import Options
from pma_gym.plant.sensors import noise_levels
from pma_gym.tasks import TASKS


@pytest.mark.parametrize(("task", "regulator"), [("displacement", False), ("rotation", True)])
def test_entries_are_those_of_the_table(make, task, regulator):
    env = make(task, noise=False, preview=2, history=3, regulator_action=regulator)
    env.reset(seed=0)
    at = TASKS[task].schedule.quantity
    span = {"extension": 25e-3, "rotation": np.pi / 2}[at]
    delayed = [env.measurement]
    for k in range(30):
        action = env.action(0.1 * k)
        observation, *_ = env.step(action)
        delayed.append(env.measurement)
        reading = env.measurement
        references = [env.reference(env.time + 0.01 * ahead) / span for ahead in range(3)]
        past = [getattr(delayed[max(-1 - back, -len(delayed))], at) / span for back in (1, 2, 3)]
        expected = [
            reading.extension / 25e-3,
            reading.rotation / (np.pi / 2),
            reading.load / 1000.0,
            reading.pressure / 600e3,
            references[0],
            references[0] - getattr(reading, at) / span,
            *references[1:],
            *action,
            *past,
        ]
        np.testing.assert_allclose(observation, expected, rtol=1e-6, atol=1e-6)
    assert len(env.table.rows) == len(observation) == len(expected)


def test_class_documentation_lists_the_entries_of_the_table():
    from pma_gym.envs import PMAEnv

    for name, _ in ObservationTable(TASKS["displacement"], Options()).rows[:6]:
        assert f"| {name} |" in (PMAEnv.__doc__ or "")


def test_without_noise_readings_are_the_lagged_truth(make):
    env = make("rotation", noise=False)
    env.reset(seed=0)
    for _ in range(100):
        env.step(env.action(3.0))
    reading, truth = env.measurement, env.truth
    # Sensors lag: LVDT 1/(2 pi 100 Hz) = 1.6 ms behind a motion of some 5 mm/s.
    assert reading.extension == pytest.approx(truth["extension"], abs=5e-5)
    assert reading.load == pytest.approx(truth["load"], abs=2.0)
    assert reading.time == env.time


@pytest.mark.parametrize("seed", [0, 1])
def test_spread_of_readings_at_rest_is_the_models_noise_and_the_quantisation(make, seed):
    env = make("rotation")
    env.reset(seed=seed)
    readings = []
    for _ in range(1500):
        env.step(env.action(0.0))
        readings.append(env.measurement[1:])
    spread = np.std(readings, axis=0)
    steps = [
        calibration.LVDT.resolution,
        calibration.POTENTIOMETER.resolution,
        calibration.LOAD_CELL.resolution,
        calibration.PRESSURE_TRANSDUCER.resolution,
    ]
    levels = noise_levels(env.plant.model)
    # Rounding to steps that are wide against the noise adds between 0 and 1/2 step, by where the
    # value lies; a fine step adds its step^2 / 12.
    for level, step, measured in zip(levels, steps, spread, strict=True):
        assert level - 0.5 * step <= measured <= np.hypot(level, 0.5 * step) * 1.05


def test_noise_is_the_models_where_no_step_of_the_daq_hides_it(make):
    from pma_gym.plant.model import load_model

    loud = {"lvdt.noise_mm": 1.0, "load_cell.noise_n": 20.0, "pressure_transducer.noise_kpa": 9.0}
    model = load_model("serres2008").replace(loud | {"potentiometer.noise_deg": 5.0})
    env = make("rotation", model=model)
    env.reset(seed=0)
    readings = []
    for _ in range(1500):
        env.step(env.action(0.0))
        readings.append(env.measurement[1:])
    # The standard deviation of 1500 normal numbers is known to 1.8 %; five of those.
    np.testing.assert_allclose(np.std(readings, axis=0), noise_levels(model), rtol=0.09)


def test_zeros_are_tared_at_rest(make, model):
    env = make(model=model)
    for seed in range(5):
        env.reset(seed=seed)
        assert abs(env.measurement.extension) < 2 * calibration.LVDT.resolution
        assert abs(env.measurement.rotation) < 2 * calibration.POTENTIOMETER.resolution


@pytest.mark.parametrize("lanes", [1, 16])
def test_zeros_are_the_same_however_many_readings_are_computed_at_once(monkeypatch, make, lanes):
    records = []
    for _ in range(2):
        env = make()
        env.reset(seed=3)
        records.append(env._engine.records.copy())
        monkeypatch.setattr("pma_gym.engine.cpu.kernel.simd_lanes", lambda: lanes)
    np.testing.assert_array_equal(*records)


def test_before_history_has_begun_the_first_reading_stands_in(make):
    env = make(history=4, observation_delay_s=0.02)
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(observation[7:], np.float32(env.measurement.extension / 25e-3))


def test_observations_are_new_arrays_within_their_space(make):
    env = make(preview=2, history=2)
    first, _ = env.reset(seed=0)
    kept = first.copy()
    for _ in range(20):
        second, *_ = env.step(env.action(4.0))
        assert env.observation_space.contains(second)
    np.testing.assert_array_equal(first, kept)
    assert first is not second
