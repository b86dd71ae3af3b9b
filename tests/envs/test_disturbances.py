"""What disturbs an episode: when it comes, how large it is, what it does to the station."""

import numpy as np
import pytest

from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model
from pma_gym.plant.plant import Plant

BOTH = "regulator_and_hand_push"


def disturbed(env: PMAEnv, seed: int, volts: float) -> tuple[np.ndarray, np.ndarray]:
    """Infos of an episode (bias V, force N, regulator V, pressure kPa, load N) and its states."""
    env.reset(seed=seed)
    rows, states, over = [], [], False
    while not over:
        *_, terminated, truncated, info = env.step(env.action(volts))
        signals = [info[name] for name in ("regulator_voltage_v", "pressure_kpa", "load_n")]
        rows.append([*env.disturbance, *signals])
        states.append(env.condition.state)
        over = terminated or truncated
    return np.array(rows), np.array(states)


def test_events_come_with_the_step_after_their_time(make):
    env = make(disturbances=BOTH)
    rest = env.nominal_plant.regulator_voltage(300e3)
    rows, states = disturbed(env, 4, 3.0)
    events, gain = env.events, env.station.model.parameters["regulator_line"].gain
    bias, force, regulator, pressure, _ = rows.T
    begins = 0.01 * np.arange(len(rows))
    jumped = np.array([events.step_sizes[events.step_times <= t + 1e-9].sum() for t in begins])
    np.testing.assert_allclose(bias, jumped / gain, atol=1e-12)
    np.testing.assert_allclose(regulator, rest + bias, rtol=1e-12)
    # A pulse is as many steps as its length needs, whichever it begins with.
    expected = np.zeros(len(rows))
    first, steps = np.ceil(100 * events.pulse_times), np.ceil(100 * events.pulse_lengths)
    for begun, lasting, size in zip(first, steps, events.pulse_forces, strict=True):
        expected[int(begun) : int(begun + lasting)] += size
    np.testing.assert_array_equal(force, expected)
    assert states[:, env.nominal_plant.states.index("memory_hand_push")].tolist() == force.tolist()
    # The regulator answers within its lag of 0.1 s.
    for when, size in zip(events.step_times, np.cumsum(events.step_sizes), strict=True):
        settled = pressure[(begins > when + 0.9) & (begins < when + 1.0)]
        assert settled == pytest.approx(300.0 + 1e-3 * size, abs=0.1)


@pytest.mark.parametrize("task", ["displacement", "isotonic"])
def test_sizes_and_times_are_as_promised(task):
    env = PMAEnv(task, disturbances=BOTH)
    times, signs, lengths = [], [], []
    for seed in range(60):
        env.reset(seed=seed)
        events = env.events
        parts = int(env.task.duration / 2.5)
        assert [len(row) for row in events] == [parts] * 5
        assert set(np.abs(events.step_sizes)) == {25e3} and set(np.abs(events.pulse_forces)) == {50}
        # Away and back: never more than one step from the line.
        assert set(np.abs(np.cumsum(events.step_sizes))) <= {0.0, 25e3}
        ends = events.pulse_times + events.pulse_lengths
        assert np.all(events.pulse_times[1:] > ends[:-1]) and np.all(np.diff(events.step_times) > 0)
        assert 0.0 < events.step_times[0] and ends[-1] < env.task.duration
        lengths += events.pulse_lengths.tolist()
        times += [events.step_times[0], events.pulse_times[0]]
        signs += [events.step_sizes[0], events.pulse_forces[0]]
    assert np.std(times) > 0.5 and 0.3 < np.mean(np.array(signs) > 0) < 0.7
    # Drawn evenly from 0.2 to 0.8 s, apart from when they come.
    assert 0.2 < min(lengths) < 0.25 and 0.75 < max(lengths) < 0.8
    assert np.mean(lengths) == pytest.approx(0.5, abs=0.05)
    assert np.std(lengths) == pytest.approx(0.6 / np.sqrt(12.0), abs=0.02)


def test_a_hand_moves_the_slide_by_its_force_over_the_stiffness():
    """At rest under a held load a force of 50 N moves the muscle by what its stiffness allows."""
    stiff = {"coulomb_friction.static_n": 0.0, "coulomb_friction.dynamic_n": 0.0}
    env = PMAEnv(model=load_model("serres2008").replace(stiff), disturbances="hand_push",
                 pressure_kpa=400.0)  # fmt: skip
    for seed in range(20):
        env.reset(seed=seed)
        if env.events.pulse_forces[0] > 0 and env.events.pulse_times[0] > 1.2:
            break
    lasted = int(np.ceil(100 * env.events.pulse_lengths[0]))
    env.reset(seed=seed)
    path = []
    for _ in range(500):
        env.step(env.action(4.0))
        path.append(env.truth["contraction"])
    begins = int(np.ceil(100 * env.events.pulse_times[0]))
    stiffness = 17.0e3 + 0.0179e3 * 400.0
    moved = path[begins + lasted - 1] - path[begins - 1]
    # The whole way but for what the lag B / K leaves of it at the pulse's end.
    left = np.exp(-0.01 * lasted * stiffness / 2.90e3)
    assert moved == pytest.approx(50.0 / stiffness * (1.0 - left), rel=2e-3)


def test_without_disturbances_nothing_is_there(make):
    env = make()
    env.reset(seed=0)
    assert env.disturbance == (0, 0.0) and env.events.step_times.size == 0
    assert "memory_hand_push" not in env.nominal_plant.states
    only = make(disturbances="regulator")
    only.reset(seed=0)
    assert only.nominal_plant.model == only.station.model
    assert only.events.pulse_times.size == 0 and only.events.step_times.size == 2


def test_an_episode_before_its_first_event_is_undisturbed(make):
    """The hand's memory costs the station nothing but rounding while nobody pulls."""
    quiet, loud = make(), make(disturbances=BOTH)
    seed = next(s for s in range(50) if _first_event(loud, s) > 0.6)
    quiet.reset(seed=seed)
    loud.reset(seed=seed)
    for _ in range(60):
        *_, first = quiet.step(quiet.action(2.5))
        *_, second = loud.step(loud.action(2.5))
    assert second == pytest.approx(first, rel=1e-9, abs=1e-9)
    assert quiet.trajectory() == pytest.approx(loud.trajectory(), rel=1e-6, abs=1e-9)


def _first_event(env: PMAEnv, seed: int) -> float:
    env.reset(seed=seed)
    return min(env.events.step_times[0], env.events.pulse_times[0])


def test_the_regulator_hears_no_more_than_10_volts(make):
    env = make(disturbances="regulator", pressure_kpa=575.0)
    highest = [disturbed(env, seed, 3.0)[0][:, 2].max() for seed in range(4)]
    assert max(highest) == 10.0 and env.ended_by == ""


def test_the_plant_goes_on_from_the_condition_as_the_environment_does(make):
    """What an oracle may do: the pulse is in the memory, the jump in the voltage heard."""
    env = make(disturbances=BOTH)
    env.reset(seed=4)
    while env.disturbance[1] == 0.0:
        env.step(env.action(3.0))
    # Controllers are told the station without the hand.
    assert "hand_push" not in env.station.model.parameters
    condition, plant = env.condition, env.plant
    env.step(env.action(2.0))
    plant.step(condition, 2.0, env.regulator_voltage, 0.01)
    np.testing.assert_allclose(condition.state, env.condition.state, rtol=1e-7, atol=1e-9)
    assert condition.state[plant.states.index("memory_hand_push")] == env.disturbance[1]


@pytest.mark.parametrize("rate", [10.0, 384.0])
def test_a_pulse_lasts_as_long_at_every_rate(make, rate):
    env = make(disturbances="hand_push", control_rate_hz=rate)
    rows, _ = disturbed(env, 2, 3.0)
    assert np.count_nonzero(rows[:, 1]) == np.ceil(env.events.pulse_lengths * rate).sum()


@pytest.mark.parametrize("tool", ["settle", "linearize", "simulate"])
def test_a_memory_without_a_rate_is_no_obstacle(tool):
    with_hand = Plant(load_model("station").with_effects({"hand_push": {"share": 1.0}}))
    bare = Plant("station")
    if tool == "settle":
        with_memory, expected = (p.settle(3.0, pressure=300e3) for p in (with_hand, bare))
        kept = [with_hand.states.index(name) for name in bare.states]
        np.testing.assert_allclose(with_memory.state[kept], expected.state, rtol=1e-12, atol=1e-15)
        assert with_memory.state[with_hand.states.index("memory_hand_push")] == 0.0
    elif tool == "linearize":
        with_memory, expected = (p.linearize(300e3, 0.03) for p in (with_hand, bare))
        np.testing.assert_allclose(with_memory.A, expected.A, rtol=1e-9, atol=1e-12)
        assert with_memory.state_labels == expected.state_labels
    else:
        condition = with_hand.settle(3.0, pressure=300e3)
        condition.state[with_hand.states.index("memory_hand_push")] = -50.0
        regulator = with_hand.regulator_voltage(300e3)
        before = with_hand.observe(condition.state[None], condition.zero_contraction)
        with_hand.step(condition, 3.0, regulator, 0.5)
        after = with_hand.observe(condition.state[None], condition.zero_contraction)
        assert condition.state[with_hand.states.index("memory_hand_push")] == -50.0
        assert after["contraction"][0] < before["contraction"][0] - 1e-3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"disturbances": "wind"}, ["disturbances must be one of none, regulator", "got 'wind'"]),
        ({"disturbances": "hand_pusch"}, ["did you mean 'hand_push'?"]),
        ({"disturbances": BOTH, "model": "cascade"}, ["disturbances=", "station", "cascade"]),
    ],
)
def test_what_cannot_be_is_refused(options, words):
    with pytest.raises(ValueError) as caught:
        PMAEnv(**options)
    for word in words:
        assert word in str(caught.value)
    assert PMAEnv(model="cascade", disturbances="regulator").reset(seed=0)
