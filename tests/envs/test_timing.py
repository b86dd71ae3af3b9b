"""When things happen: actions are held, compared, delayed and sampled at the right instants."""

import numpy as np
import pytest

from pma_gym.metrics import PHASE_SAMPLES, phase_times, rmse
from pma_gym.plant.plant import Plant

MODELS = [("station", "rotation"), ("serres2008", "displacement"), ("cascade", "displacement")]


@pytest.mark.parametrize(("model", "task"), MODELS)
def test_states_are_those_of_the_plant_under_the_held_voltages(make, task, model):
    env = make(task, model=model)
    env.reset(seed=1)
    volts, states = [], [env.condition.state.copy()]
    for k in range(200):
        env.step(env.action(0.01 * k))
        volts.append(env.motor_voltage)
        states.append(env.condition.state.copy())
    time = np.arange(201) / 100.0
    plant = Plant(model)
    regulator = np.full(201, plant.regulator_voltage(300e3))
    rest = plant.settle(0.0, pressure=300e3)
    expected, _ = plant.run(
        time, np.append(volts, 0.0), regulator, interpolation="zoh", condition=rest
    )
    # The same steps in other compiled code, which rounds in another order.
    scale = np.abs(expected).max(axis=0)
    assert np.all(np.abs(states - expected) <= 1e-10 * scale)


@pytest.mark.parametrize(
    ("task", "rate", "steps"),
    [
        ("displacement", 1000.0, 5006),
        ("displacement", 384.0, 1922),
        ("rotation", 20.0, 301),
    ],
)
def test_episode_ends_with_its_last_sample(make, follow, task, rate, steps):
    env = make(task, control_rate_hz=rate)
    info = follow(env, lambda time: 0.0)
    assert info["time_s"] == pytest.approx(steps / rate)
    assert len(env.motor_voltages) == steps
    needed = round((len(env.task.schedule.phases) - 1) * 5 * 384) + PHASE_SAMPLES
    position = env.trajectory()
    assert needed <= len(position) <= needed + 384 / rate
    assert np.all(np.isfinite(position))


def test_reference_and_position_are_compared_at_the_same_time(make):
    env = make()
    env.reset(seed=0)
    for k in range(1, 101):
        *_, info = env.step(env.action(1.0))
        assert info["time_s"] == pytest.approx(0.01 * k)
        assert info["reference_mm"] == pytest.approx(5.0 * 0.01 * k)
        position = 1e3 * (env.condition.zero_contraction - env.condition.state[0])
        assert info["extension_mm"] == pytest.approx(position, abs=1e-12)
        assert info["error_mm"] == pytest.approx(position - 0.05 * k, abs=1e-12)


@pytest.mark.parametrize(
    ("task", "rates"),
    [("displacement", (100.0, 384.0, 1000.0)), ("rotation", (20.0, 100.0))],
)
def test_samples_are_the_same_at_every_control_rate(make, follow, ramp, task, rates):
    scores, paths = [], []
    for rate in rates:
        env = make(task, control_rate_hz=rate)
        # 384 Hz does not hit every step of the ramp: let it wait for the next of its instants.
        info = follow(env, lambda time: ramp(time + 1e-9))
        scores.append(info[f"rmse_{env.task.schedule.unit}"])
        paths.append(env.trajectory()[:1921])
    np.testing.assert_allclose(scores, scores[0], rtol=1e-6)
    for path in paths[1:]:
        np.testing.assert_allclose(path, paths[0], rtol=0, atol=2e-6)


def test_rmse_is_that_of_the_trajectory(make, follow, ramp):
    env = make("rotation")
    info = follow(env, ramp)
    ideals = [lambda t: 18 * t, lambda t: 90 + 0 * t, lambda t: 90 - 18 * t]
    path = np.degrees(env.trajectory())
    errors = [
        path[1920 * i : 1920 * i + 1923] - ideal(phase_times()) for i, ideal in enumerate(ideals)
    ]
    by_phase = list(env.episode_summary()["rmse_by_phase_deg"].values())
    assert by_phase == pytest.approx([rmse(error) for error in errors])
    assert info["rmse_deg"] == pytest.approx(rmse(np.concatenate(errors)))
    assert info["percent_of_range"] == pytest.approx(100 * info["rmse_deg"] / 90)
    assert env.ended_by == ""


def test_a_delayed_action_acts_so_many_whole_steps_later(make):
    steps, prompt = 10, make()
    late = make(action_delay_s=0.01 * steps)
    prompt.reset(seed=0)
    late.reset(seed=0)
    volts = [1.0 + 0.05 * k for k in range(40)]
    states = []
    for volt in volts:
        *_, info = prompt.step(prompt.action(volt))
        states.append(prompt.condition.state.copy())
        assert info["motor_voltage_v"] == pytest.approx(volt)
    for k in range(40):
        observation, *_, info = late.step(late.action(volts[k]))
        expected = volts[k - steps] if k >= steps else 0.0
        assert info["motor_voltage_v"] == pytest.approx(expected)
        # The agent remembers what it asked for, not what has arrived.
        assert observation[6] == pytest.approx(volts[k] / 5.0 - 1.0)
        if k < steps:
            assert abs(info["extension_mm"]) < 1e-9
    # `steps` steps of rest, then the same motion, up to rounding and what comes of it.
    np.testing.assert_allclose(late.condition.state, states[39 - steps], rtol=1e-7, atol=1e-9)


def test_a_delayed_reading_is_that_of_so_many_steps_before(make):
    steps, prompt = 4, make(history=2)
    late = make(history=2, observation_delay_s=0.01 * steps)
    prompt.reset(seed=3)
    late.reset(seed=3)
    readings, observations = [prompt.measurement], [None]
    for k in range(1, 60):
        observations.append(prompt.step(prompt.action(1.5))[0])
        readings.append(prompt.measurement)
        observation = late.step(late.action(1.5))[0]
        assert late.measurement == readings[max(k - steps, 0)]
        if k > steps:
            measured = [0, 1, 2, 3, 7, 8]
            np.testing.assert_array_equal(observation[measured], observations[k - steps][measured])
        assert late.truth == prompt.truth
