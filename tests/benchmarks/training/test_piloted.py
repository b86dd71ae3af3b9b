"""Many piloted environments are one of them, as often as there are, bit for bit."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import gymnasium as gym

from benchmarks.training.policy_batch import PilotedVecEnv
from benchmarks.training.policy_env import PilotedEnv
from controllers.policies.adapter import ActionMapping
from controllers.policies.observation_spec import ObservationSpec
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
    return PilotedVecEnv(COUNT, task, view, form, nominal, **more, **options)


def single(view, form, options, name=DISPLACEMENT):
    form = {key: value for key, value in form.to_json().items() if value is not None}
    return PilotedEnv(gym.make(name), view.to_json(), form, options=options)


@pytest.mark.parametrize("case", CASES)
def test_the_batch_is_the_one_environment(case):
    view, form, options = CASES[case]
    envs, singles = batch(view, form, options), [single(view, form, options) for _ in range(COUNT)]
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
    assert ended >= COUNT
    envs.close()


def test_rotation_too():
    view, form, options = CASES["increment"]
    envs = batch(view, form, options, "rotation")
    one = single(view, form, options, "pma_gym/IsokineticRotation-v0")
    envs.seed(5)
    np.testing.assert_array_equal(envs.reset()[0], one.reset(seed=5)[0])
    for action in np.linspace(-0.3, 1.0, 30, dtype=np.float32):
        seen = envs.step(np.full((COUNT, 1), action))[0]
        np.testing.assert_array_equal(seen[0], one.step(np.array([action]))[0])
    envs.close()


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
    envs = PilotedVecEnv(
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
        PilotedEnv(gym.make("CartPole-v1"), view={}, form={})
