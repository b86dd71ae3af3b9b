from collections.abc import Callable

import numpy as np
import pytest

from controllers import Controller, Oracle
from pma_gym.envs import Measurement, PMAEnv, StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS


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
        env.reset(seed=seed)
        if isinstance(controller, Oracle):
            controller.receive(env)
        controller.reset(env.reference, env.station)
        ended, info = False, {}
        while not ended:
            voltage = controller.act(env.measurement, env.time)
            assert 0.0 <= voltage <= 10.0
            *_, terminated, truncated, info = env.step(env.action(voltage))
            ended = terminated or truncated
        assert info["limit_code"] == 0
        by_phase = env.episode_summary()[f"rmse_by_phase_{env.task.schedule.suffix}"]
        return by_phase, env.voltages

    return run
