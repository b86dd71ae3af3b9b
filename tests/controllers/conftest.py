from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from controllers import Controller, Oracle
from pma_gym.envs import Measurement, PMAEnv, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS


def trial(controller: Controller, env: PMAEnv, seed=1, nominal=None) -> dict:
    """Last info of a trial; a controller may be told another model than the station's."""
    env.reset(seed=seed)
    if isinstance(controller, Oracle):
        controller.receive(env)
    information = env.station if nominal is None else replace(env.station, model=nominal)
    controller.reset(env.reference, information)
    ended, info = False, {}
    while not ended:
        voltage = controller.act(env.measurement, env.time)
        assert 0.0 <= voltage <= 10.0
        *_, terminated, truncated, info = env.step(env.action(voltage))
        ended = terminated or truncated
    assert info["limit_code"] == 0
    return info


def by_phase(env: PMAEnv) -> dict[str, float]:
    """RMSE of the episode that ended, by phase (mm, deg or N m)."""
    return env.episode_summary()[f"rmse_by_phase_{env.task.schedule.suffix}"]


@pytest.fixture
def station() -> Callable[..., StationInfo]:
    """A station for a task and pressure (kPa)."""

    def make(task="displacement", pressure_kpa=300.0, model="station", period=0.01):
        return StationInfo(load_model(model), TASKS[task], 1e3 * pressure_kpa, period)

    return make


@pytest.fixture
def reading() -> Callable[..., Measurement]:
    """What the sensors say, zero where nothing is given (SI)."""

    def make(extension=0.0, rotation=0.0, time=0.0, load=0.0):
        return Measurement(time, extension, rotation, load, 300e3)

    return make


@pytest.fixture
def drive() -> Callable[..., tuple[dict[str, float], np.ndarray]]:
    """RMSE by phase (mm or deg) and voltages of a trial with sensor noise at 100 Hz."""

    def run(controller: Controller, task, pressure_kpa, model="station", seed=1, **options):
        env = PMAEnv(task, model=model, pressure_kpa=float(pressure_kpa), **options)
        trial(controller, env, seed)
        return by_phase(env), env.voltages

    return run
