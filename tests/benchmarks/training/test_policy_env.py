"""Many environments behind a view and a form are one of them, many times, bit for bit."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import gymnasium as gym
from stable_baselines3.common.monitor import Monitor

from benchmarks.training.policy_batch import PolicyVecEnv
from benchmarks.training.policy_env import BROKEN_REWARD, LEAST_REWARD, PolicyEnv, bounded
from benchmarks.training.preset import load_preset
from controllers.policies.adapter import ActionMapping
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.envs import PMAEnv
from pma_gym.plant.model import load_model

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
COUNT = 3
SLOW = {"control_rate_hz": 20.0, "pressure_kpa": [200.0, 300.0, 400.0]}
LATE = SLOW | {"action_delay_s": 0.05, "observation_delay_s": 0.1}
CASES = {
    "increment": (ObservationSpec("tracking", 2, 3), ActionMapping("increment", 0.5), SLOW),
    "direct, late": (ObservationSpec("tracking", 0, 0), ActionMapping("direct", 5.0), LATE),
    "residual, late, disturbed": (
        ObservationSpec("tracking", 1, 2),
        ActionMapping("residual", 0.3, "feedforward_pid"),
        LATE | {"disturbances": "regulator_and_hand_push", "pressure_kpa": [200.0, 400.0]},
    ),
    "another model": (
        ObservationSpec("tracking", 1, 1),
        ActionMapping("residual", 0.3, "feedforward_pid"),
        SLOW | {"model": "serres2008"},
    ),
}


def batch(view, form, options, task="displacement", **more):
    nominal = options.get("model", "station")
    return PolicyVecEnv(COUNT, task, view, form, nominal, **more, **options)


def single(view, form, options, env, scale):
    form = {key: value for key, value in form.to_json().items() if value is not None}
    return PolicyEnv(env, view.to_json(), form, options=options, reward_scale=scale)


TASKS = {
    "rotation": [200.0, 300.0, 400.0],
    "isokinetic_exercise": [300.0, 400.0, 550.0],
    "profile_exercise": [460.0, 540.0],
}
"""Pressures (kPa) of tasks beside displacement; at 50 Hz, as exercises ask for."""


@pytest.mark.parametrize(
    ("case", "task", "scale"),
    [*((case, "displacement", 1.0) for case in CASES), *(("increment", t, 0.1) for t in TASKS)],
)
def test_the_batch_is_the_one_environment(case, task, scale):
    view, form, options = CASES[case]
    if task in TASKS:
        options = {"control_rate_hz": 50.0, "pressure_kpa": TASKS[task]}
    envs = batch(view, form, options, task, reward_scale=scale)
    singles = [single(view, form, options, PMAEnv(task), scale) for _ in range(COUNT)]
    actions = np.random.default_rng(1).uniform(-1.5, 1.5, (150, COUNT, 1)).astype(np.float32)
    envs.seed(5)
    seen = envs.reset()
    theirs = [one.reset(seed=5 + i)[0] for i, one in enumerate(singles)]
    np.testing.assert_array_equal(seen, theirs)
    assert envs.observation_space == singles[0].observation_space
    ended = 0
    for given in actions:
        seen, rewards, over, infos = envs.step(given)
        for i, one in enumerate(singles):
            entries, reward, terminated, truncated, _ = one.step(given[i])
            assert np.float32(reward) == rewards[i] and over[i] == (terminated or truncated)
            if over[i]:
                ended += 1
                np.testing.assert_array_equal(infos[i]["terminal_observation"], entries)
                assert infos[i]["TimeLimit.truncated"] == truncated
                entries, _ = one.reset()
            np.testing.assert_array_equal(seen[i], entries)
    assert ended >= COUNT or task in TASKS
    envs.close()


def test_rewards_are_bounded_before_they_are_scaled():
    rewards = np.array([-0.5, -30.0, -30.0])
    limited = bounded(rewards, np.array([False, False, True]), 0.01)
    np.testing.assert_allclose(limited, [-0.005, 0.01 * LEAST_REWARD, 0.01 * -30.0])
    assert bounded(-1e4, True) == BROKEN_REWARD


# -- staggered -------------------------------------------------------------------------------------


def ends_of(envs, steps):
    """By environment: when its episodes ended and what was told of them; actions of zero."""
    envs.seed(5)
    envs.reset()
    ends = [[] for _ in range(envs.num_envs)]
    for step in range(1, steps + 1):
        _, _, over, infos = envs.step(np.zeros((envs.num_envs, 1), np.float32))
        for i in np.flatnonzero(over):
            ends[i].append((step, infos[i]))
    return ends


def test_only_first_episodes_are_cut_and_at_different_times():
    view, form, options = CASES["increment"]
    envs = batch(view, form, options, staggered=True)
    whole = envs.envs.task.steps(20.0)
    endings = ends_of(envs, 2 * whole)
    firsts = {ends[0][0] for ends in endings}
    assert len(firsts) == COUNT and max(firsts) <= whole
    for (first, cut), (second, last) in (ends[:2] for ends in endings):
        assert second - first == whole
        # Cut, not failed: what would have come after counts.
        assert cut["TimeLimit.truncated"] and last["TimeLimit.truncated"]
        assert cut["episode"]["l"] == first and last["episode"]["l"] == whole
        # Only whole trials have errors.
        assert "rmse_displacement_mm" not in cut and last["rmse_displacement_mm"] > 0.0
    envs.close()


def test_a_cut_trials_last_view_is_its_own():
    view, form, options = CASES["increment"]
    cut, whole = batch(view, form, options, staggered=True), batch(view, form, options)
    first = min(ends[0][0] for ends in ends_of(cut, 100))
    cut.seed(5)
    whole.seed(5)
    cut.reset(), whole.reset()
    nothing = np.zeros((COUNT, 1), np.float32)
    for _ in range(first):
        (began, _, over, infos), (goes_on, *_) = cut.step(nothing), whole.step(nothing)
    (i,) = np.flatnonzero(over)
    np.testing.assert_array_equal(infos[i]["terminal_observation"], goes_on[i])
    assert not np.array_equal(began[i], goes_on[i])
    cut.close(), whole.close()


def test_a_broken_limit_is_no_time_limit():
    fragile = load_model("serres2008").replace({"limits.tension_n": 300.0})
    envs = PolicyVecEnv(
        COUNT, "displacement", ObservationSpec("tracking", 1, 1), ActionMapping("direct", 5.0),
        "serres2008", model=fragile, pressure_kpa=300.0, control_rate_hz=20.0,
    )  # fmt: skip
    envs.seed(1)
    envs.reset()
    for _ in range(60):
        _, _, over, infos = envs.step(np.ones((COUNT, 1), np.float32))
        if over.any():
            break
    assert over.all() and not any(info["TimeLimit.truncated"] for info in infos)
    assert all(np.isfinite(info["terminal_observation"]).all() for info in infos)
    envs.close()


def test_an_action_that_is_no_number_is_refused():
    view, form, options = CASES["increment"]
    envs = batch(view, form, options)
    envs.reset()
    with pytest.raises(ValueError, match=r"finite number, that of trial 1 got nan"):
        envs.step(np.array([[0.0], [np.nan], [0.0]], np.float32))
    # Nothing has happened.
    assert np.isfinite(envs.step(np.zeros((COUNT, 1), np.float32))[0]).all()
    envs.close()


def test_a_view_of_its_own_needs_an_environment_of_ours():
    with pytest.raises(TypeError, match="env must be one of pma_gym, got CartPole"):
        PolicyEnv(gym.make("CartPole-v1"), view={}, form={})


# -- one environment -------------------------------------------------------------------------------


# increment-late has options of its own: half the rate, so half the steps.
@pytest.mark.parametrize(("preset", "steps"), [("increment", 501), ("increment-late", 251)])
def test_wrappers_stay_around_the_environment_made_anew(preset, steps):
    made = load_preset(preset, "ppo", DISPLACEMENT)
    monitored = PolicyEnv(Monitor(gym.make(DISPLACEMENT)), **made.wrapper)
    single = PolicyEnv(PMAEnv("displacement"), **made.wrapper)
    assert monitored.unwrapped is monitored.rig
    first, _ = monitored.reset(seed=3)
    assert np.array_equal(first, single.reset(seed=3)[0])
    rng, total, ended = np.random.default_rng(1), 0.0, False
    while not ended:
        action = rng.uniform(-1.0, 1.0, 1).astype(np.float32)
        seen, reward, terminated, truncated, info = monitored.step(action)
        same, *others = single.step(action)
        assert np.array_equal(seen, same) and others[:3] == [reward, terminated, truncated]
        total, ended = total + reward, terminated or truncated
    assert info["episode"]["l"] == steps
    # The wrapper inside sees the environment's own rewards, which are not bounded.
    assert info["episode"]["r"] < total
