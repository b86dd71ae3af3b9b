"""Policies of exercises: trained as others are, of a kind and with a view of their own."""

import io
import re

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

from rich.console import Console

from benchmarks.training import run
from benchmarks.training.policy_batch import measure_of
from benchmarks.training.preset import PresetError
from benchmarks.training.run import Order
from benchmarks.training.stations import Stations
from benchmarks.training.train_policies import EXERCISE, ordered, policy_name, run_train
from controllers.policies.policy_file import load_policy_file
from controllers.policy import Policy, shipped_policies
from pma_gym.envs import PMAEnv, PMAVectorEnv
from pma_gym.plant.model import load_model

# -- from order to policy --------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3", "tqc"])
def test_a_training_leaves_a_policy_that_drives_an_exercise(
    algorithm, preset, monkeypatch, tmp_path
):
    monkeypatch.setattr(run, "EVALUATIONS", 1)
    options = {"control_rate_hz": 50.0, "pressure_kpa": 400.0}
    asked = preset(algorithm, environment=EXERCISE, options=options, n_timesteps=256)
    path = run_train(Order(asked, seed=3), tmp_path, Console(file=io.StringIO()))
    assert path.name == f"isokinetic-50hz-{algorithm}.json"
    driven = Policy(path)
    assert driven.file.task == "isokinetic"
    assert 0.0 < driven.file.training["scores"]["validation"]["error"] < 90.0
    env = PMAEnv("isokinetic_exercise", **options)
    env.reset(seed=1)
    driven.reset(env.reference, env.station)
    for _ in range(20):
        _, _, terminated, *_ = env.step(env.action(driven.act(env.measurement, env.time)))
        assert not terminated


def test_exercises_are_trained_by_name():
    usual = ordered("ppo", "exercise", "increment", 0, None, 1)
    named = ordered("ppo", "isokinetic_exercise", "increment", 0, None, 1)
    assert usual.preset.wrapper == named.preset.wrapper
    assert usual.preset.task == "isokinetic_exercise"
    assert policy_name(usual.preset) == "isokinetic-100hz-ppo"
    for name in ("isotonic_exercise", "isotonic_exercise_6.5", "profile_exercise"):
        preset = ordered("ppo", name, "increment", 0, None, 1).preset
        assert (preset.environment, preset.task) == (EXERCISE, name)
        assert policy_name(preset) == "moment-100hz-ppo"
        # All phases count: here nobody pulls the muscle back.
        assert measure_of(name).phases(name) == ["I", "II", "III"]
    with pytest.raises(PresetError, match=r"one of displacement, .*exercise, isotonic_exercise"):
        ordered("ppo", "isotonic_exercize", "increment", 0, None, 1)


# -- stations --------------------------------------------------------------------------------------


def test_drawn_stations_carry_the_leg_that_controllers_are_told_of():
    drawn = Stations("robust", 0, 2)
    given = drawn.options | {"pressure_kpa": 400.0}
    envs = PMAVectorEnv(6, "isokinetic_exercise", disturbances="hand_push", **given)
    envs.reset(seed=1)
    models = envs.engine.models
    assert {model.name for model in models} == {"station-0", "station-1"}
    # What controllers are told is the nominal one.
    assert envs.engine.nominal_model.name == "station"
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
    made = ordered("ppo", command[1], command[2], 0, None, 1).preset
    assert (made.env.adapter.view, made.env.adapter.form) == (policy.view, policy.form)
    assert policy_name(made) == policy.name
