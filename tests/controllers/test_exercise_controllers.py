"""Controllers of the exercises: what they refuse, and what a loop is worth."""

import numpy as np
import pytest

from controllers import CONTROLLERS
from pma_gym.envs import PMAEnv


def rmse(name, task, seed, **options):
    env = PMAEnv(task, **options)
    env.reset(seed=seed)
    controller = CONTROLLERS[name]()
    controller.reset(env.reference, env.station)
    ended, info = False, {}
    while not ended:
        *_, over, done, info = env.step(env.action(controller.act(env.reading, env.time)))
        ended = over or done
    assert info["ended_by"] is None
    return np.sqrt([env._engine.numbers(f"sum_{p.name}")[0] for p in env.task.protocol.phases])


@pytest.mark.parametrize("options", [{}, {"control_rate_hz": 50.0, "action_delay_s": 0.02}])
def test_a_loop_on_the_speed_halves_the_errors_of_a_constant_pressure(options):
    both = [
        np.mean([rmse(name, "isokinetic_exercise", seed, **options) for seed in range(6)], axis=0)
        for name in ("speed_pid", "constant_pressure")
    ]
    assert np.all(both[0] < 0.5 * both[1])


@pytest.mark.parametrize("task", ["isotonic_exercise", "profile_exercise"])
def test_schedule_beats_one_pressure_and_a_loop_beats_the_schedule(task):
    names = "moment_pid", "scheduled_pressure", "constant_pressure"
    loop, schedule, constant = (rmse(name, task, 1) for name in names)
    assert np.all(loop < schedule) and np.all(schedule < constant)


@pytest.mark.parametrize(
    ("name", "task"),
    [
        ("speed_pid", "isotonic_exercise"),
        ("moment_pid", "isokinetic_exercise"),
        ("scheduled_pressure", "isokinetic_exercise"),
        ("constant_pressure", "rotation"),
    ],
)
def test_what_a_controller_cannot_do_is_refused(name, task):
    env = PMAEnv(task)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=f"{name}.*got {task}"):
        CONTROLLERS[name]().reset(env.reference, env.station)
