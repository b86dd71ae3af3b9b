"""Model predictive control of exercises: better than what it is told to beat, and its parts."""

import numpy as np
import pytest

from controllers import CONTROLLERS, ExerciseMPC
from controllers.exercise.leg_observer import (
    Horizon,
    Joint,
    LegObserver,
    PressureObserver,
    ProcessNoise,
    leg_of,
    predicted,
)
from controllers.exercise.resistance import AWAY_PA
from pma_gym.envs import Measurement, PMAEnv


def rmse(name, task, seed, **options):
    env = PMAEnv(task, **options)
    env.reset(seed=seed)
    controller = CONTROLLERS[name]()
    controller.reset(env.reference, env.station)
    ended, info = False, {}
    while not ended:
        voltage = controller.act(env.measurement, env.time)
        assert 0.0 <= voltage <= 10.0
        *_, terminated, truncated, info = env.step(env.action(voltage))
        ended = terminated or truncated
    assert info["limit_code"] == 0
    key = f"rmse_by_phase_{env.task.schedule.suffix}"
    return np.array(list(env.episode_summary()[key].values()))


@pytest.fixture(scope="module")
def station():
    env = PMAEnv("isokinetic_exercise")
    env.reset(seed=0)
    return env.station


@pytest.mark.parametrize("options", [{}, {"control_rate_hz": 50.0, "action_delay_s": 0.02}])
def test_it_halves_the_errors_of_a_constant_pressure_in_every_phase(options):
    task, seeds = "isokinetic_exercise", range(3)
    mpc, constant = (
        np.mean([rmse(name, task, seed, **options) for seed in seeds], axis=0)
        for name in ("exercise_mpc", "constant_pressure")
    )
    assert np.all(mpc < 0.5 * constant)


@pytest.mark.parametrize("task", ["isotonic_exercise", "profile_exercise"])
def test_it_holds_a_moment_better_than_the_schedule(task):
    for seed in range(2):
        assert np.all(rmse("exercise_mpc", task, seed) < rmse("scheduled_pressure", task, seed))


def test_it_is_no_worse_with_old_readings_than_a_loop_is():
    options = {"action_delay_s": 0.02, "observation_delay_s": 0.03}
    mpc, loop = (
        rmse(name, "isotonic_exercise", 1, **options) for name in ("exercise_mpc", "moment_pid")
    )
    assert np.all(mpc < loop)


def test_a_task_that_is_no_exercise_is_refused():
    env = PMAEnv("rotation")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="exercise_mpc.*got rotation"):
        ExerciseMPC().reset(env.reference, env.station)


def test_at_rest_the_operator_gives_the_moment_of_the_load_cell(station):
    observer = LegObserver(station, ProcessNoise())
    radius = station.model.parameters["rotor"].radius
    load, moment = 250.0, 250.0 * radius
    wound = 0.4 * radius - load / station.model.parameters["cable"].stiffness
    for i in range(1000):
        observer.update(Measurement(station.period * i, wound, 0.4, load, station.pressure))
    np.testing.assert_allclose(observer.state, [0.4, 0.0, moment, 0.0, 0.0], atol=1e-3)


def test_what_the_operator_gives_beyond_the_load_turns_the_leg(station):
    observer, (inertia, damping) = LegObserver(station, ProcessNoise()), leg_of(station)
    radius = station.model.parameters["rotor"].radius
    speed, moment = 0.3, damping * 0.3
    for i in range(1000):
        angle = speed * station.period * (i + 1)
        observer.update(Measurement(0.0, radius * angle, angle, 0.0, station.pressure))
    assert inertia > 0.45
    np.testing.assert_allclose(observer.state[1:3], [speed, moment], rtol=1e-3)


def test_a_regulator_that_gives_less_is_found_out_and_a_held_one_is_not_taken_for_it(station):
    for off, estimated in ((-5e3, -5e3), (-200e3, -AWAY_PA)):
        observer = PressureObserver(station, ProcessNoise())
        for _ in range(500):
            observer.update(300e3 + off, 300e3)
        assert observer.offset == pytest.approx(estimated, abs=1.0)


def test_what_is_foreseen_is_what_the_equations_give():
    joint = Joint(0.45, 1.0, 0.055, 0.3, 2.5, stiffness=9.0, muscle=0.7)
    horizon = Horizon(0.01, 2, 10, 0)
    outputs = np.eye(6)[:1]
    state, drift, command = predicted(joint, outputs, horizon)
    # A push held for good comes to rest where the two stiffnesses bear it.
    long = Horizon(0.01, 10, 60, 0)
    rest = predicted(joint, outputs, long)[1][0, -1].sum()
    assert rest == pytest.approx(1.0 / (joint.stiffness + joint.operator), rel=1e-3)
    # A pressure's moment acts against it, and no less in the end.
    held = predicted(joint, outputs, long)[2][0, -1].sum()
    assert held == pytest.approx(-rest, rel=1e-3)
    assert state.shape == (1, 10, 6) and drift.shape == command.shape == (1, 10, 20)
    assert np.all(drift[0, 0, 2:] == 0.0)
