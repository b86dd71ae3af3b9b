"""What the agent sees: the observation's table, the sensors' noise, zeros and history."""

import numpy as np
import pytest

from pma_gym.data import calibration
from pma_gym.engine.observation import ObservationTable
from pma_gym.engine.options import Options
from pma_gym.plant.sensors import noise_levels
from pma_gym.tasks import TASKS


def test_entries_are_those_of_the_table(make):
    task, regulator = "rotation", True
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


def test_spread_of_readings_at_rest_is_the_models_noise_and_the_quantisation(make):
    env = make("rotation")
    env.reset(seed=0)
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


@pytest.mark.parametrize("model", ["station", "cascade"])
def test_zeros_are_tared_at_rest(make, model):
    env = make(model=model)
    for seed in range(5):
        env.reset(seed=seed)
        assert abs(env.measurement.extension) < 2 * calibration.LVDT.resolution
        assert abs(env.measurement.rotation) < 2 * calibration.POTENTIOMETER.resolution


def test_zeros_are_the_same_however_many_readings_are_computed_at_once(monkeypatch, make):
    records = []
    for _ in range(2):
        env = make()
        env.reset(seed=3)
        records.append(env._engine.records.copy())
        monkeypatch.setattr("pma_gym.engine.engine_memory.simd_lanes", lambda: 1)
    np.testing.assert_array_equal(*records)


def test_before_history_has_begun_the_first_reading_stands_in(make):
    env = make(history=4, observation_delay_s=0.02)
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(observation[7:], np.float32(env.measurement.extension / 25e-3))
