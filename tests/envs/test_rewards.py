"""`reward_scale`, and rewards by a user's function: the same alone and in a batch."""

import math
import pickle

import gymnasium as gym
import numpy as np
import pytest

from pma_gym.envs import PMAEnv, PMAVectorEnv

MADE = {"model": "serres2008", "pressure_kpa": 300.0, "control_rate_hz": 10.0}
STEPS = 60


def absolute(error_percent, action_change, position, reference):
    """The reward `absolute`, as a user would write it."""
    return -abs(error_percent)


def smooth(error_percent, action_change, position, reference):
    """The reward `smooth`."""
    return -abs(error_percent) - 0.1 * action_change


def rewards_of(env, seed=3, high=1.0) -> list[float]:
    """Rewards of an episode under random actions."""
    generator = np.random.default_rng(seed)
    env.reset(seed=seed)
    collected = []
    for _ in range(STEPS):
        action = generator.uniform(-1.0, high, env.action_space.shape).astype(np.float32)
        _, reward, terminated, truncated, _ = env.step(action)
        assert type(reward) is float
        collected.append(reward)
        if terminated or truncated:
            break
    return collected


def test_a_function_gives_what_the_reward_of_that_name_gives_where_the_regulator_acts():
    named, own = (rewards_of(PMAEnv("isotonic_exercise", reward=r)) for r in ("smooth", smooth))
    # The error goes through the info's unit, which rounds once more.
    np.testing.assert_allclose(own, named, rtol=1e-12)


@pytest.mark.parametrize(("function", "name"), [(absolute, "absolute"), (smooth, "smooth")])
def test_a_broken_limit_costs_what_it_costs_by_name(fragile, function, name):
    made = {**MADE, "model": fragile}
    named, own = (rewards_of(PMAEnv(reward=r, **made), high=1.0) for r in (name, function))
    assert len(own) < 51 and own[-1] < -100.0
    np.testing.assert_allclose(own, named, rtol=1e-12)


def test_a_function_gets_floats_and_what_the_info_says():
    seen = []

    def reward(error_percent, action_change, position, reference):
        seen.append((error_percent, action_change, position, reference))
        return 1.5

    env = PMAEnv(reward=reward, **MADE)
    env.reset(seed=1)
    assert not seen
    _, value, *_, info = env.step(np.array([0.25]))
    assert value == 1.5 and len(seen) == 1 and all(type(one) is float for one in seen[0])
    error, change, position, reference = seen[0]
    assert (position, reference) == (info["extension_mm"], info["reference_mm"])
    assert error == pytest.approx(100.0 * info["error_mm"] / 25.0) and change == 1.25
    env.step(np.array([0.0]))
    assert seen[1][1] == 0.25


@pytest.mark.parametrize(
    ("name", "scale"), [("gaussian", 1e-3), ("smooth", np.float64(2.0)), (smooth, 0.25)]
)
def test_a_scale_multiplies_every_reward(fragile, name, scale):
    made = {**MADE, "model": fragile, "reward": name}
    plain = rewards_of(PMAEnv(**made))
    scaled = rewards_of(PMAEnv(reward_scale=scale, **made))
    assert scaled == [scale * reward for reward in plain]
    assert rewards_of(PMAEnv(reward_scale=1, **made)) == plain
    envs = PMAVectorEnv(9, reward_scale=scale, **made)
    envs.reset(seed=3)
    generator = np.random.default_rng(3)
    for reward in scaled:
        actions = np.tile(generator.uniform(-1.0, 1.0, (1, 1)), (9, 1)).astype(np.float32)
        assert envs.step(actions)[1][0] == reward


def test_a_function_that_returns_no_number_is_named():
    message = "reward must be a function of four numbers .*it returned"
    for value in (None, "0.5", math.nan, -math.inf, True, 1j, np.zeros(2)):
        made = MADE | {"reward": lambda *given, value=value: value}
        for env in (PMAEnv(**made), PMAVectorEnv(2, **made)):
            env.reset(seed=1)
            with pytest.raises(ValueError, match=message):
                env.step(np.zeros(env.action_space.shape))


def test_a_function_of_other_arguments_is_refused_when_the_environment_is_made():
    for function in (lambda error: 0.0, lambda: 0.0, lambda a, b, c, d, e: 0.0):
        with pytest.raises(ValueError, match="reward must be a name or a function of four numbers"):
            PMAEnv(reward=function)
    for fine in (lambda *given: 0.0, lambda a, b, c, d, e=1: 0.0):
        PMAEnv(reward=fine)


def test_actions_are_still_refused_before_the_function_is_called():
    calls = []
    env = PMAEnv(reward=lambda *given: calls.append(1) or 0.0, **MADE)
    env.reset(seed=1)
    for bad in ([math.nan], [0.1, 0.2], "fast"):
        with pytest.raises(ValueError, match="action"):
            env.step(bad)
    assert not calls
    assert env.step([0.5])[1] == 0.0 and len(calls) == 1
    fresh = PMAEnv(reward=absolute, **MADE)
    with pytest.raises(gym.error.ResetNeeded):
        fresh.step(np.zeros(1))


def test_numpy_numbers_are_numbers_and_options_pickle_with_their_function():
    env = PMAEnv(reward=lambda error, *rest: np.float32(error), **MADE)
    assert all(type(reward) is float for reward in rewards_of(env))
    assert pickle.loads(pickle.dumps(PMAEnv(reward=absolute).options)).reward is absolute
