"""Bad input to batches: refused by name and rule, and nothing has changed."""

import gymnasium as gym
import numpy as np
import pytest

from pma_gym.engine.engine import ActionError
from pma_gym.envs import PMAVectorEnv

MADE = {"model": "serres2008", "pressure_kpa": 300, "control_rate_hz": 10.0}


def state(envs: PMAVectorEnv) -> list[bytes]:
    engine = envs.engine
    arrays = (engine.records, engine.observations, engine.rewards)
    return [array.tobytes() for array in (*arrays, engine.terminated, engine.truncated)]


@pytest.mark.parametrize("count", [0, -1, 2.0, True, "4", None])
@pytest.mark.parametrize("name", ["num_envs", "threads"])
def test_bad_numbers_are_refused(name, count):
    with pytest.raises(ValueError, match=f"{name} must be a whole number in 1-.*got {count!r}"):
        PMAVectorEnv(**(MADE | {name: count}))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"presure_kpa": 1}, TypeError, ["'presure_kpa'", "did you mean 'pressure_kpa'?"]),
        ({"task": "lift"}, ValueError, ["task must be one of", "'lift'"]),
        ({"model": "seres2008"}, ValueError, ["did you mean 'serres2008'?"]),
        ({"precision": "half"}, ValueError, ["precision must be one of double, single", "'half'"]),
        ({"autoreset_mode": "NextStop"}, ValueError, ["one of NextStep", "did you mean 'NextS"]),
        ({"render_mode": "human"}, ValueError, ["render_mode must be one of rgb_array", "'human'"]),
        ({"pressures_kpa": [200]}, ValueError, ["one pressure for each of the 3", "got 1: [200]"]),
        ({"pressures_kpa": "random"}, ValueError, ["one pressure for each", "'random'"]),
        ({"pressures_kpa": 300}, ValueError, ["one pressure for each", "300"]),
        ({"pressures_kpa": [200, 300, 900]}, ValueError, ["150-575 kPa", "got 900"]),
        ({"pressures_kpa": [200] * 3, "pressure_kpa": 300}, ValueError, ["give either pressure"]),
    ],
)
def test_bad_options_are_refused(options, error, words):
    with pytest.raises(error) as caught:
        PMAVectorEnv(**({"num_envs": 3, "model": "serres2008"} | options))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        (np.zeros(3), ["shape (3, 1)", "got shape (3,)"]),
        (np.zeros((1, 3)), ["got shape (1, 3)"]),
        (0.3, ["got shape ()"]),
        (np.array([[0.0], [np.nan], [0.0]]), ["finite", "environment 1 got [nan]", "diverged"]),
        (np.array([[0.0], [0.0], [np.inf]]), ["finite", "environment 2 got [inf]"]),
        (np.array([[-np.inf], [0.0], [np.inf]]), ["finite", "environment 0 got [-inf]"]),
        (np.ones((3, 1), bool), ["no real numbers"]),
        (np.ones((3, 1), complex), ["no real numbers"]),
        ([["fast"]] * 3, ["no real numbers"]),
        ([[0.0], [0.0, 1.0], [0.0]], ["no real numbers"]),
        (None, ["no real numbers"]),
    ],
)
def test_bad_actions_are_refused_and_change_nothing(batch, actions, words):
    envs, same = batch(threads=2), batch()
    for one in (envs, same):
        one.reset(seed=0)
        one.step(np.full((3, 1), -0.5))
    before = state(envs)
    with pytest.raises(ValueError) as caught:
        envs.step(actions)
    for word in ("actions must have shape (3, 1)", *words):
        assert word in str(caught.value)
    assert state(envs) == before
    next_ones = [one.step(np.full((3, 1), -0.3)) for one in (envs, same)]
    np.testing.assert_array_equal(next_ones[0][0], next_ones[1][0])


def test_a_bad_action_of_one_threads_share_changes_no_other(batch):
    envs = batch(64, threads=4)
    envs.reset(seed=0)
    before = state(envs)
    actions = np.zeros((64, 1))
    actions[50] = np.nan
    with pytest.raises(ValueError, match="environment 50 got"):
        envs.step(actions)
    assert state(envs) == before


@pytest.mark.parametrize("options", [{"regulator_action": True}, {"precision": "single"}])
def test_every_entry_of_an_action_is_looked_at(batch, options):
    envs = batch(5, **options)
    envs.reset(seed=0)
    before = state(envs)
    actions = np.zeros(envs.action_space.shape)
    actions[4, -1] = np.inf
    with pytest.raises(ValueError, match="environment 4 got"):
        envs.step(actions)
    envs.engine.actions[4, -1] = np.nan
    with pytest.raises(ActionError, match="finite"):
        envs.engine.step()
    assert state(envs) == before


def test_actions_of_an_episode_that_is_over_mean_nothing(batch):
    envs = batch(1)
    envs.reset(seed=0)
    for _ in range(51):
        *_, truncated, _ = envs.step(np.full((1, 1), -0.9))
    assert truncated.all()
    _, rewards, _, truncated, _ = envs.step(np.full((1, 1), np.nan))
    assert rewards[0] == 0.0 and not truncated.any()
    with pytest.raises(ValueError, match="finite"):
        envs.step(np.full((1, 1), np.nan))


def test_no_step_before_the_start(batch):
    envs = batch()
    with pytest.raises(gym.error.ResetNeeded, match=r"no episode has begun: call reset\(\)"):
        envs.step(np.zeros((3, 1)))
    envs.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(gym.error.ResetNeeded, match=r"in environments \[1\]: call reset\(\)"):
        envs.step(np.zeros((3, 1)))
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    envs.step(np.zeros((3, 1)))


def test_no_step_after_the_end_without_autoreset(batch):
    envs = batch(autoreset_mode="Disabled")
    envs.reset(seed=0)
    for _ in range(51):
        envs.step(np.full((3, 1), -0.9))
    message = r"environments \[0, 1, 2\] have ended.*call reset\(options=\{\"reset_mask\""
    with pytest.raises(gym.error.ResetNeeded, match=message):
        envs.step(np.zeros((3, 1)))


@pytest.mark.parametrize("seed", [[1], [1, 2, 3, 4], -1, [0, -1, 2], 1.5, "1", True, [0, 1.0, 2]])
def test_bad_seeds_are_refused_and_change_nothing(batch, seed):
    envs = batch()
    envs.reset(seed=0)
    before = state(envs)
    with pytest.raises(ValueError, match="seed must be a whole number from 0 on, or one for each"):
        envs.reset(seed=seed)
    assert state(envs) == before
    envs.step(np.zeros((3, 1)))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"presure": 3}, TypeError, "unknown reset option 'presure'"),
        ({"pressure_kpa": 900}, ValueError, "150-575 kPa"),
        ({"pressures_kpa": [200, 300]}, ValueError, "one pressure for each of the 3"),
        ({"pressures_kpa": [200] * 3, "pressure_kpa": 300}, ValueError, "either pressure_kpa"),
        ({"reset_mask": np.ones(2, bool)}, ValueError, "bool of shape (3,)"),
        ({"reset_mask": np.ones(3, int)}, ValueError, "got int64 of shape (3,)"),
        ({"reset_mask": np.zeros(3, bool)}, ValueError, "at least one true"),
    ],
)
def test_bad_reset_options_are_refused_and_change_nothing(batch, options, error, words):
    envs = batch()
    envs.reset(seed=0)
    before = state(envs)
    with pytest.raises(error) as caught:
        envs.reset(options=options)
    assert words in str(caught.value)
    assert state(envs) == before
    envs.step(np.zeros((3, 1)))
