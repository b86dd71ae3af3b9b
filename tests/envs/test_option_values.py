"""Values of options: NumPy's numbers, arrays, ranges and paths, as plain Python values in specs."""

import json
import shutil
from dataclasses import fields
from fractions import Fraction
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from pma_gym.engine.options import EnvironmentOptions, parse_options
from pma_gym.envs import Options, PMAEnv, PMAVectorEnv
from pma_gym.plant.model import shipped_models

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"

SAME = [
    ("pressure_kpa", np.linspace(200, 400, 5), [200.0, 250.0, 300.0, 350.0, 400.0]),
    ("pressure_kpa", range(200, 401, 50), [200, 250, 300, 350, 400]),
    ("pressure_kpa", (200, np.float32(300.5)), [200, 300.5]),
    ("pressure_kpa", np.array(300.0), 300.0),
    ("pressure_kpa", np.str_("random"), "random"),
    ("pressure_kpa", Fraction(601, 2), 300.5),
    ("noise", np.True_, True),
    ("noise", np.array(False), False),
    ("regulator_action", np.False_, False),
    ("preview", np.array(2, np.uint8), 2),
    ("history", np.int32(1), 1),
    ("control_rate_hz", np.int64(50), 50),
    ("action_delay_s", np.float64(0.02), 0.02),
    ("observation_delay_s", np.array(0.04), 0.04),
    ("tolerance", np.array(1e-3), 1e-3),
    ("reward_scale", np.float32(0.5), 0.5),
    ("reward", np.str_("smooth"), "smooth"),
    ("reference", np.array(["displacement"]), ["displacement"]),
]


def test_values_are_kept_plain():
    for name, value, plain in SAME:
        kept = getattr(parse_options({name: value}), name)
        assert kept == plain and type(kept) is type(plain)
        if isinstance(plain, list):
            assert [type(one) for one in kept] == [type(one) for one in plain]


def test_they_survive_json_alone_and_in_batches():
    # The last of each name.
    values = {name: value for name, value, _ in SAME}
    plains = {name: plain for name, _, plain in SAME}
    made = [gym.make(DISPLACEMENT, **values), gym.make_vec(DISPLACEMENT, 2, **values)]
    for make, env in zip((gym.make, gym.make_vec), made, strict=True):
        assert env.unwrapped.options == PMAEnv(**plains).options
        assert plains.items() <= json.loads(env.spec.to_json())["kwargs"].items()
        again = make(EnvSpec.from_json(env.spec.to_json()))
        np.testing.assert_array_equal(again.reset(seed=4)[0], env.reset(seed=4)[0])


@pytest.mark.parametrize("kind", [np.array, tuple])
@pytest.mark.parametrize("rows", [[200.0, 300.0], [[200.0, 300.0], [250.0, 350.0]]])
def test_pressures_of_each_come_in_any_sequence(kind, rows):
    made = {"model": "serres2008", "num_envs": 2}
    expected, _ = PMAVectorEnv(pressures_kpa=rows, **made).reset(seed=3)
    envs = gym.make_vec(DISPLACEMENT, pressures_kpa=kind(rows), **made)
    np.testing.assert_array_equal(envs.reset(seed=3)[0], expected)
    assert json.loads(envs.spec.to_json())["kwargs"]["pressures_kpa"] == rows
    envs = PMAVectorEnv(**made)
    np.testing.assert_array_equal(
        envs.reset(seed=3, options={"pressures_kpa": kind(rows)})[0], expected
    )


def test_numbers_of_steps_may_be_of_numpy():
    assert PMAEnv(max_episode_steps=np.int64(50)).options.max_episode_steps == 50
    envs = gym.make_vec(DISPLACEMENT, 2, max_episode_steps=np.array(50))
    assert json.loads(envs.spec.to_json())["kwargs"]["max_episode_steps"] == 50


def test_arguments_of_a_batch_survive_json_too():
    envs = gym.make_vec(
        DISPLACEMENT, np.int64(3), threads=np.int32(1), autoreset_mode=AutoresetMode.SAME_STEP
    )
    again = gym.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert again.num_envs == 3 and again.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP


def test_paths_of_models_are_kept_as_text(tmp_path):
    path = tmp_path / "rig of my own.toml"
    shutil.copy(shipped_models()["serres2008"], path)
    for given in (path, str(path), np.str_(path)):
        env = gym.make(DISPLACEMENT, model=given)
        assert env.spec is not None and type(env.unwrapped.options.model) is str
        again = gym.make(EnvSpec.from_json(env.spec.to_json()))
        np.testing.assert_array_equal(again.reset(seed=1)[0], env.reset(seed=1)[0])
    assert PMAEnv(model=Path("serres2008")).station.model.name == "serres2008"


@pytest.mark.parametrize("seed", [np.int64(5), np.array(5), np.uint8(5)])
def test_seeds_may_be_numbers_of_numpy(seed):
    expected, _ = PMAEnv().reset(seed=5)
    np.testing.assert_array_equal(PMAEnv().reset(seed=seed)[0], expected)
    envs = PMAVectorEnv(2)
    np.testing.assert_array_equal(envs.reset(seed=seed)[0][0], expected)
    for several in (np.array([5, 9]), [np.int64(5), 9], range(5, 7), (np.array(5), None)):
        np.testing.assert_array_equal(envs.reset(seed=several)[0][0], expected)


@pytest.mark.parametrize("seed", [True, np.True_, -1, 2.5, "5", np.array([1, 2])])
def test_bad_seeds_are_refused(seed):
    with pytest.raises(ValueError, match=r"seed must be a whole number from 0 on"):
        PMAEnv().reset(seed=seed)
    with pytest.raises(ValueError, match=r"seed must be a whole number from 0 on"):
        PMAVectorEnv(3).reset(seed=seed)


def test_pressures_of_a_reset_may_be_of_numpy():
    env, other = PMAEnv(), PMAEnv()
    for given, plain in ((np.array([200.0, 300.0]), [200.0, 300.0]), (np.float32(250), 250.0)):
        first, _ = env.reset(seed=2, options={"pressure_kpa": given})
        np.testing.assert_array_equal(
            other.reset(seed=2, options={"pressure_kpa": plain})[0], first
        )


def test_editors_know_the_type_of_every_option():
    known = {field.name: field.type for field in fields(Options)}
    assert EnvironmentOptions.__annotations__ == known
