"""Policies of exercises: trained as others are, of a kind and with a view of their own."""

import re

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

import gymnasium as gym

from benchmarks.training import run
from benchmarks.training.configuration.preset import PresetError
from benchmarks.training.policy_batch import PilotedVecEnv
from benchmarks.training.policy_env import PilotedEnv
from benchmarks.training.policy_export.product import policy_name, policy_of
from benchmarks.training.reward import BROKEN_REWARD, LEAST_REWARD, bounded
from benchmarks.training.run import Order, train
from benchmarks.training.stations import Stations
from benchmarks.training.train_policies import EXERCISE, ordered
from benchmarks.training.validation import measure_of
from controllers.policies.adapter import ActionMapping
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import load_policy_file, save_policy_file
from controllers.policy import Policy, shipped_policies
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.model import load_model

COUNT = 3
SLOW = {"control_rate_hz": 50.0}
CASES = {
    "isokinetic_exercise": [300.0, 400.0, 550.0],
    "profile_exercise": [460.0, 540.0],
}
"""Exercises, and pressures that their episodes begin at (kPa)."""


@pytest.mark.parametrize("task", CASES)
def test_the_batch_is_the_one_environment(task):
    view, form = ObservationSpec("tracking", 2, 3), ActionMapping("increment", 0.5)
    options = SLOW | {"pressure_kpa": CASES[task]}
    envs = PilotedVecEnv(COUNT, task, view, form, reward_scale=0.1, **options)
    given = {"kind": "increment", "authority_v": 0.5}
    singles = [
        PilotedEnv(PMAEnv(task), view.to_json(), given, options=options, reward_scale=0.1)
        for _ in range(COUNT)
    ]
    actions = np.random.default_rng(1).uniform(-1.2, 1.2, (60, COUNT, 1)).astype(np.float32)
    envs.seed(5)
    seen = envs.reset()
    np.testing.assert_array_equal(seen, [one.reset(seed=5 + i)[0] for i, one in enumerate(singles)])
    for given_now in actions:
        seen, rewards, over, _ = envs.step(given_now)
        assert not over.any()
        for i, one in enumerate(singles):
            entries, reward, *_ = one.step(given_now[i])
            assert np.float32(reward) == rewards[i]
            np.testing.assert_array_equal(seen[i], entries)
    envs.close()


def test_the_zoo_makes_it_from_its_id():
    env = PilotedEnv(
        gym.make(EXERCISE),
        {"kind": "tracking", "preview": 1, "history": 1},
        {"kind": "increment", "authority_v": 0.5},
    )
    assert env.reset(seed=1)[0].shape == env.observation_space.shape


# -- from order to policy --------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3", "tqc"])
def test_a_training_leaves_a_policy_that_drives_an_exercise(
    algorithm, preset, monkeypatch, tmp_path
):
    monkeypatch.setattr(run, "EVALUATIONS", 1)
    options = {"control_rate_hz": 50.0, "pressure_kpa": 400.0}
    asked = preset(algorithm, environment=EXERCISE, options=options, steps=256, reward_scale=0.01)
    order = Order(asked, seed=3)
    trained = train(order, tmp_path, lambda steps, point: None)
    assert 0.0 < trained.final.error < 90.0
    policy = policy_of(order, trained)
    assert policy.task == "isokinetic" and policy.name == f"isokinetic-50hz-{algorithm}"
    driven = Policy(save_policy_file(policy, tmp_path / policy.name))
    env = PMAEnv("isokinetic_exercise", **options)
    env.reset(seed=1)
    driven.reset(env.reference, env.station)
    for _ in range(20):
        _, _, terminated, *_ = env.step(env.action(driven.act(env.measurement, env.time)))
        assert not terminated


def test_exercises_are_trained_by_name():
    usual = ordered("ppo", "exercise", "increment", 0, None, "cpu", 1, 0)
    assert usual == ordered("ppo", "isokinetic_exercise", "increment", 0, None, "cpu", 1, 0)
    assert usual.preset.task == "isokinetic_exercise"
    assert policy_name(usual.preset) == "isokinetic-100hz-ppo"
    for name in ("isotonic_exercise", "isotonic_exercise_6.5", "profile_exercise"):
        preset = ordered("ppo", name, "increment", 0, None, "cpu", 1, 0).preset
        assert (preset.environment, preset.task) == (EXERCISE, name)
        assert policy_name(preset) == "moment-100hz-ppo"
        # All phases count: here nobody pulls the muscle back.
        assert measure_of(name).phases(name) == ["I", "II", "III"]
    with pytest.raises(PresetError, match=r"one of displacement, .*exercise, isotonic_exercise"):
        ordered("ppo", "isotonic_exercize", "increment", 0, None, "cpu", 1, 0)


def test_rewards_are_bounded_before_they_are_scaled():
    rewards = np.array([-0.5, -30.0, -30.0])
    limited = bounded(rewards, np.array([False, False, True]), 0.01)
    np.testing.assert_allclose(limited, [-0.005, 0.01 * LEAST_REWARD, 0.01 * -30.0])
    assert bounded(-1e4, True) == BROKEN_REWARD


# -- stations --------------------------------------------------------------------------------------


def test_drawn_stations_carry_the_leg_that_controllers_are_told_of():
    drawn = Stations("robust", 0, 2)
    given = {"randomisation": drawn, "model": drawn.structure, "pressure_kpa": 400.0}
    envs = PMAVectorEnv(6, "isokinetic_exercise", disturbances="hand_push", **given)
    envs.reset(seed=1)
    models = envs.engine.models
    assert {model.name for model in models} == {"station-0", "station-1"}
    nominal = envs.engine.nominal.parameters["leg"]
    assert nominal.inertia > 0.0 and all(model.parameters["leg"] == nominal for model in models)
    assert "hand_push" in models[0].parameters
    # One that is asked for neither has neither, as for the other tasks.
    plain = drawn(load_model("station"), np.random.default_rng(0))
    assert not {"leg", "hand_push"} & set(plain.parameters)
    envs.close()


def test_operators_differ_from_seed_to_seed():
    envs = PMAVectorEnv(4, "isokinetic_exercise", pressure_kpa=400.0)
    envs.reset(seed=4_000_000)
    efforts = envs.engine.numbers("operator_effort")
    assert len(set(efforts.tolist())) == 4
    envs.close()


def test_the_card_of_an_exercise_says_what_moves_and_how_it_is_made_again():
    (path,) = [path for path in shipped_policies() if path.stem == "isokinetic-100hz-ppo"]
    policy = load_policy_file(path)
    words = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "its action changes the regulator voltage by up to 1 V a step" in words
    command = re.search(r"--algo ppo --task (\S+) --preset (\S+) --seed", words)
    assert command is not None
    made = ordered("ppo", command[1], command[2], 0, None, "cpu", 1, 0).preset
    assert (made.view, made.form) == (policy.view, policy.form)
    assert policy_name(made) == policy.name
