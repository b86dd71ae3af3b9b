"""The environments as Gymnasium knows them: ids, specs, vectors, and its checker's verdict."""

import json

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import pma_gym
from pma_gym.envs import ENVIRONMENTS, PMAEnv

SEVERAL = {
    "preview": 4, "history": 3, "regulator_action": True, "action_delay_s": 0.02,
    "observation_delay_s": 0.03, "reward": "smooth", "randomisation": "varied",
    "pressure_kpa": "random", "render_mode": "rgb_array",
}  # fmt: skip
"""Nearly everything at once."""

MADE = {"model": "serres2008", "pressure_kpa": 300}
DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
ISOTONIC = "pma_gym/IsotonicContraction-v0"
EXERCISE = "pma_gym/ResistiveExercise-v0"


def test_check_env_finds_nothing_to_say_of_a_cascade():
    # pytest turns each warning into an error.
    made = {"model": "cascade", "pressure_kpa": [300, 400.0], "noise": False}
    check_env(gym.make(DISPLACEMENT, **made).unwrapped)
    drawn = {"task": "displacement_steps", "reference": "random"}
    check_env(gym.make(DISPLACEMENT, **made, **drawn).unwrapped)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_check_env_finds_nothing_to_say_of_nearly_everything_at_once(name):
    options = dict(SEVERAL)
    if name in (ISOTONIC, EXERCISE):
        # Their action is the regulator's already.
        del options["regulator_action"]
    check_env(gym.make(name, **(MADE | options)).unwrapped)


@pytest.mark.parametrize(
    ("name", "task"),
    [("pma_gym/IsokineticRotation-v0", "rotation_multisine_3"), (EXERCISE, "profile_exercise")],
)
def test_check_env_finds_nothing_to_say_of_other_tasks_and_disturbances(name, task):
    env = gym.make(name, task=task, disturbances="regulator_and_hand_push").unwrapped
    assert env.task.name == task
    check_env(env)


def test_spec_survives_json():
    given = {
        "model": "serres2008", "pressure_kpa": [200, 300.5], "control_rate_hz": 50.0, "preview": 2,
        "noise": False, "action_delay_s": 0.02, "observation_delay_s": 0.04, "history": 1,
        "reward": "smooth", "randomisation": "varied", "regulator_action": True,
        "disturbances": "regulator_and_hand_push",
    }  # fmt: skip
    env = gym.make("pma_gym/IsokineticRotation-v0", **given)
    assert env.spec is not None
    text = env.spec.to_json()
    assert json.loads(text)["kwargs"] == {"task": "rotation"} | given
    again = gym.make(gym.envs.registration.EnvSpec.from_json(text))
    assert again.unwrapped.options == env.unwrapped.options
    first, _ = env.reset(seed=4)
    second, _ = again.reset(seed=4)
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("task", ["displacement_speeds_12", "isokinetic_exercise"])
def test_names_of_tasks_survive_json(task):
    env = gym.make("pma_gym/IsokineticDisplacement-v0", task=task, pressure_kpa=300.0)
    assert env.spec is not None
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.task == env.unwrapped.task
    np.testing.assert_array_equal(again.reset(seed=4)[0], env.reset(seed=4)[0])


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_nothing_stands_between_an_agent_and_an_environment_that_checks_itself(name):
    env = gym.make(f"pma_gym:{name}")
    assert type(env) is PMAEnv and env.task.name == pma_gym.ENVIRONMENTS[name]
    assert env.spec.id == name and env.station.model.name == "station"
    with pytest.raises(gym.error.ResetNeeded, match=r"call reset\(\) before step\(\)"):
        env.step(env.action_space.sample())
    check_env(env)
    checked = gym.make(name, disable_env_checker=False)
    checked.reset(seed=1)
    assert isinstance(checked, gym.wrappers.PassiveEnvChecker)
    assert len(checked.step(checked.action_space.sample())) == 5
