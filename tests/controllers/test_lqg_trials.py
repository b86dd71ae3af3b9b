"""Feedback on a station that differs from its model: what is left of offsets and disturbances."""

import numpy as np
import pytest

from controllers import LQG, PID, ImprovedFeedforward, PreviewMPC
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.tasks import varied_station
from tests.controllers.conftest import trial


def driven(controller, task="displacement", **options):
    """A trial on a drawn station at 50 Hz, commands 20 ms late: its last info, its environment."""
    nominal = load_model("station")
    model = varied_station(nominal, np.random.default_rng(3))
    late = {"control_rate_hz": 50.0, "action_delay_s": 0.02}
    env = PMAEnv(task, model=model, pressure_kpa=300.0, **late, **options)
    return trial(controller, env, 3, nominal), env


def test_integral_action_leaves_no_offset_where_another_station_is_held():
    left = []
    for controller in (LQG(), ImprovedFeedforward()):
        _, env = driven(controller, task="rotation")
        held = env.trajectory()[round(7.0 * 384) : round(9.5 * 384)]
        left.append(abs(np.rad2deg(held.mean()) - 90.0))
    # Half a step of the potentiometer's reading, 0.344 deg, cannot be seen.
    assert left[0] < 0.172
    assert left[0] < 0.1 * left[1]


@pytest.mark.parametrize(("kind", "share"), [(LQG, 0.9), (PreviewMPC, 0.8)])
def test_disturbances_move_it_less_than_the_pid(kind, share):
    ours, pid = (
        driven(each(), disturbances="regulator_and_hand_push")[0]["rmse_mm"] for each in (kind, PID)
    )
    assert ours < share * pid
