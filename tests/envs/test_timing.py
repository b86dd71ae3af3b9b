"""When things happen: actions are held, compared, delayed and sampled at the right instants."""

import numpy as np
import pytest

from pma_gym.metrics import PHASE_SAMPLES, phase_times, rmse
from pma_gym.plant.model import shipped_models
from pma_gym.plant.plant import Plant

EVERY_MODEL = [
    *((name, "displacement") for name in sorted(shipped_models())),
    ("station", "rotation"),
]


@pytest.mark.parametrize(("model", "task"), EVERY_MODEL)
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
        ("displacement", 100.0, 501),
        ("rotation", 100.0, 1501),
        ("displacement", 384.0, 1922),
        ("rotation", 20, 301),
        ("displacement", 1000.0, 5006),
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


def test_truncated_only_at_the_end(make):
    env = make(control_rate_hz=10.0)
    env.reset(seed=0)
    ends = [env.step(env.action(0.0))[2:4] for _ in range(51)]
    assert ends == [(False, False)] * 50 + [(False, True)]


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
    [("displacement", (20.0, 100.0, 384.0, 1000.0)), ("rotation", (20.0, 100.0))],
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


def test_samples_at_the_ends_of_steps_are_the_states_there(make):
    env = make(control_rate_hz=384.0 / 5.0)
    env.reset(seed=0)
    for _ in range(60):
        env.step(env.action(2.0))
        assert env.trajectory()[-1] == pytest.approx(env.truth["extension"], abs=1e-12)
    assert len(env.trajectory()) == 301


@pytest.mark.parametrize("task", ["displacement", "rotation"])
def test_rmse_is_that_of_the_trajectory(make, follow, ramp, task):
    env = make(task)
    info = follow(env, ramp)
    unit, factor = env.task.schedule.unit, {"mm": 1e-3, "deg": np.pi / 180}[env.task.schedule.unit]
    ideals = {"mm": [lambda t: 5 * t]} | {
        "deg": [lambda t: 18 * t, lambda t: 90 + 0 * t, lambda t: 90 - 18 * t]
    }
    path = env.trajectory() / factor
    errors = [
        path[1920 * i : 1920 * i + 1923] - ideal(phase_times())
        for i, ideal in enumerate(ideals[unit])
    ]
    by_phase = list(env.episode_summary()[f"rmse_by_phase_{unit}"].values())
    assert by_phase == pytest.approx([rmse(error) for error in errors])
    assert info[f"rmse_{unit}"] == pytest.approx(rmse(np.concatenate(errors)))
    span = {"mm": 25, "deg": 90}[unit]
    assert info["percent_of_range"] == pytest.approx(100 * info[f"rmse_{unit}"] / span)
    assert env.ended_by == ""


@pytest.mark.parametrize("steps", [1, 10])
def test_a_delayed_action_acts_so_many_whole_steps_later(make, steps):
    prompt = make()
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


@pytest.mark.parametrize("steps", [1, 4])
def test_a_delayed_reading_is_that_of_so_many_steps_before(make, steps):
    prompt = make(history=2)
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


def test_preview_holds_the_references_of_the_steps_to_come(make):
    env = make("rotation", preview=3, control_rate_hz=10.0)
    observation, _ = env.reset(seed=0)
    for k in range(150):
        ideal = [env.reference(0.1 * (k + ahead)) / (np.pi / 2) for ahead in range(4)]
        np.testing.assert_allclose(observation[[4, 6, 7, 8]], ideal, atol=1e-6)
        observation, *_ = env.step(env.action(0.0))


@pytest.mark.parametrize(("model", "task"), EVERY_MODEL)
def test_zero_volts_keep_the_muscle_at_rest(make, model, task):
    env = make(task, model=model)
    _, start = env.reset(seed=0)
    truth = dict(env.truth)
    for _ in range(300):
        *_, info = env.step(env.action(0.0))
    # 0.1 nm, 0.1 nrad, and the pressure to 10 digits.
    assert env.truth == pytest.approx(truth, rel=1e-10, abs=1e-10)
    position = {"displacement": "extension_mm", "rotation": "rotation_deg"}[task]
    assert info[position] == pytest.approx(0.0, abs=1e-6)
    assert info["pressure_kpa"] == pytest.approx(start["pressure_kpa"]) == pytest.approx(300.0)
