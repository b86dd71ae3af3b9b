"""What is exported does what the model does, and what a policy file does not hold is refused."""

import json
import re

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

import torch
from gymnasium import spaces
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.training.policy_export.agreement import AGREEMENT, ExportError, drawn_observations
from benchmarks.training.policy_export.from_sb3 import weights_from_sb3
from benchmarks.training.policy_export.onnx_file import onnx_bytes
from benchmarks.training.policy_export.users_model import algorithm_of
from controllers.policies.adapter import ActionMapping
from controllers.policies.network import Network
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import load_policy_file
from controllers.policy import Policy
from pma_gym.envs import StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS
from tests.controllers.drawn_policies import drawn_policy

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
LEARNING = {"learning_starts": 16, "buffer_size": 500, "batch_size": 16}
MODELS = {
    "ppo": (PPO, {"n_steps": 64, "batch_size": 32}, nn.Tanh),
    "ppo_relu": (PPO, {"n_steps": 64, "batch_size": 32}, nn.ReLU),
    "sac": (SAC, LEARNING, nn.ReLU),
    "sac_tanh": (SAC, LEARNING, nn.Tanh),
    "td3": (TD3, LEARNING, nn.ReLU),
    "tqc": (TQC, LEARNING, nn.ReLU),
}


class Small(gym.Env):
    """An environment of nothing: noise to see, and an action that had better be small."""

    def __init__(self, seen=None, action=None):
        self.observation_space = seen or spaces.Box(-5.0, 5.0, (6,), np.float32)
        self.action_space = action or spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 20
        return self.observation_space.sample(), {}

    def step(self, action):
        self.left -= 1
        reward = -float(np.sum(np.square(action)))
        return self.observation_space.sample(), reward, False, self.left == 0, {}


def learned(name, env=None, steps=96):
    kind, options, activation = MODELS[name]
    arch = {"activation_fn": activation, "net_arch": [32, 32]}
    env = Small() if env is None else env
    model = kind("MlpPolicy", env, policy_kwargs=arch, seed=0, device="cpu", **options)
    return model.learn(steps)


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


# -- the same actions ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_the_actions_are_the_models_own(name):
    model = learned(name)
    rows = drawn_observations(6)
    theirs, _ = model.predict(rows, deterministic=True)
    ours = Network(weights_from_sb3(model)).many(rows)
    assert np.max(np.abs(ours - theirs)) < AGREEMENT
    assert np.ptp(ours) > 0.01


def test_with_the_statistics_of_vecnormalize():
    envs = VecNormalize(DummyVecEnv([Small]), clip_obs=2.0)
    model = learned("ppo", envs)
    envs.training = False
    rows = drawn_observations(6)
    theirs, _ = model.predict(envs.normalize_obs(rows), deterministic=True)
    scaled = Network(weights_from_sb3(model, envs)).many(rows)
    assert np.max(np.abs(scaled - theirs)) < AGREEMENT
    assert np.max(np.abs(Network(weights_from_sb3(model)).many(rows) - theirs)) > 0.01


def test_training_on_does_not_change_what_was_exported():
    model = learned("sac")
    weights = weights_from_sb3(model)
    before = Network(weights).many(drawn_observations(6))
    model.learn(64)
    assert np.array_equal(Network(weights).many(drawn_observations(6)), before)


# -- refused ---------------------------------------------------------------------------------------


def _in(seen=None, action=None, kind=PPO, policy="MlpPolicy", **options):
    return lambda: kind(policy, Small(seen, action), device="cpu", **options)


IMAGE = spaces.Box(0, 255, (3, 36, 36), np.uint8)
REFUSED = {
    r"must be rows of floats, it takes Dict": _in(
        spaces.Dict({"a": spaces.Box(-1.0, 1.0, (2,))}), policy="MultiInputPolicy"
    ),
    r"must be rows of floats, it takes Box\(0, 255": _in(IMAGE, policy="CnnPolicy"),
    r"must have one action of -1 to 1, .* it has Discrete": _in(action=spaces.Discrete(3)),
    r"must have one action of -1 to 1, .* it has Box\(-1.0, 1.0, \(2,\)": _in(
        action=spaces.Box(-1.0, 1.0, (2,))
    ),
    r"must have one action of -1 to 1, .* it has Box\(0.0, 10.0": _in(
        action=spaces.Box(0.0, 10.0, (1,)), kind=SAC
    ),
    r"explores by its state \(use_sde\)": _in(use_sde=True),
    r"Linear, ELU, Linear, ELU, Linear; train it with activation_fn": _in(
        policy_kwargs={"activation_fn": nn.ELU}
    ),
    r"this RecurrentPPO has a sb3_contrib.*RecurrentActorCriticPolicy": _in(
        kind=RecurrentPPO, policy="MlpLstmPolicy"
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_a_policy_file_does_not_hold_is_refused(message):
    with pytest.raises(ExportError, match=message):
        weights_from_sb3(REFUSED[message]())


def test_another_features_extractor_is_refused():
    class Doubled(FlattenExtractor):
        def forward(self, observations):
            return 2.0 * super().forward(observations)

    model = _in(policy_kwargs={"features_extractor_class": Doubled})()
    with pytest.raises(ExportError, match="observations go through a Doubled"):
        weights_from_sb3(model)


def test_a_model_that_computes_something_else_is_found_out():
    model = _in()()
    model.policy.features_extractor.register_forward_hook(lambda *given: 1.01 * given[-1])
    with pytest.raises(ExportError, match="must agree to .* they differ by .*: the model computes"):
        weights_from_sb3(model)


def test_weights_that_are_no_numbers_are_refused():
    model = _in()()
    with torch.no_grad():
        model.policy.action_net.bias[0] = np.nan
    with pytest.raises(ExportError, match="must be finite, 1 of them are NaN or infinite"):
        weights_from_sb3(model)


# -- ONNX ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scaled", [False, True])
@pytest.mark.parametrize("output", ["clip", "tanh"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_onnx_computes_the_same(activation, output, scaled):
    onnx = pytest.importorskip("onnx")
    from onnx.reference import ReferenceEvaluator

    parts = {"activation": activation, "output": output, "scaled": scaled}
    station = StationInfo(load_model("station"), TASKS["displacement"], 3e5, 0.01)
    policy = drawn_policy(station, view=ObservationSpec(), form=ActionMapping(), **parts)
    content = onnx_bytes(policy)
    rows = np.random.default_rng(3).normal(size=(20, len(policy.observation)))
    rows = rows.astype(np.float32)
    (actions,) = ReferenceEvaluator(onnx.load_from_string(content)).run(None, {"observation": rows})
    assert actions.dtype == np.float32 and actions.shape == (20, 1)
    np.testing.assert_allclose(actions, Network(policy.weights).many(rows), atol=AGREEMENT)
    words = {entry.key: entry.value for entry in onnx.load_from_string(content).metadata_props}
    assert words["task"] == "displacement"
    assert ObservationSpec.of(json.loads(words["view"])) == policy.view
    assert ActionMapping.of(json.loads(words["form"])) == policy.form
    assert [tuple(row) for row in json.loads(words["observation"])] == list(policy.observation)
    assert onnx_bytes(policy) == content


# -- the command -----------------------------------------------------------------------------------


def run(*words):
    return CliRunner().invoke(app, ["export", *map(str, words)])


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A user's own model: its zip, and the model."""
    env = gym.make(DISPLACEMENT, preview=2, pressure_kpa=300, model="serres2008")
    model = learned("ppo", env, steps=64)
    path = tmp_path_factory.mktemp("own") / "mine.v2.zip"
    model.save(path)
    return path, model


KWARGS = '{"preview": 2, "model": "serres2008"}'


def test_a_users_own_model_drives_as_a_policy_as_it_did_as_an_agent(saved, tmp_path):
    path, model = saved
    out = tmp_path / "own-100hz"
    done = run(path, "--env", DISPLACEMENT, "--env-kwargs", KWARGS, "--out", out, "--trust")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.split() == [f"{out}.json", f"{out}.safetensors"]
    policy = Policy(out)
    file = policy.file
    assert (file.view, file.form) == (
        ObservationSpec("environment", 2, 0),
        ActionMapping("direct", 5.0),
    )
    assert (file.training["algorithm"], file.training["steps"], file.task) == (
        "ppo",
        64,
        "displacement",
    )
    env = gym.make(DISPLACEMENT, **json.loads(KWARGS)).unwrapped
    observation, _ = env.reset(seed=3, options={"pressure_kpa": 300})
    policy.reset(env.reference, env.station)
    for _ in range(100):
        action, _ = model.predict(observation, deterministic=True)
        volts = policy.act(env.measurement, env.time)
        assert abs(volts - (5.0 + 5.0 * float(action[0]))) < 1e-5
        observation, *_ = env.step(action)


def test_onnx_beside_it(saved, tmp_path):
    pytest.importorskip("onnx")
    words = (saved[0], "--env", DISPLACEMENT, "--env-kwargs", KWARGS, "--algo", "ppo")
    done = run(*words, "--out", tmp_path / "own", "--onnx", "--trust")
    assert done.exit_code == 0, done.stderr
    assert (tmp_path / "own.onnx").read_bytes() == onnx_bytes(load_policy_file(tmp_path / "own"))


def test_nothing_is_loaded_without_trust(saved, tmp_path, monkeypatch):
    monkeypatch.setattr(PPO, "load", lambda *_, **__: pytest.fail("it was loaded"))
    done = run(saved[0], "--env", DISPLACEMENT, "--out", tmp_path / "own")
    assert done.exit_code == 2 and not list(tmp_path.iterdir())
    assert "holds pickles, and loading one runs whatever code its maker put there" in done.stderr
    assert "add --trust" in done.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--env", "CartPole-v1"), "--env must be one of pma_gym/Isokinetic"),
        (("--env-kwargs", "{preview: 2}"), "--env-kwargs must be a JSON object such as"),
        (("--env-kwargs", "[2]"), r"--env-kwargs must be a JSON object .* got '\[2\]'"),
        (
            ("--env-kwargs", '{"previw": 2}'),
            "unexpected keyword argument 'previw' .did you mean 'preview'",
        ),
        (
            ("--env-kwargs", '{"preview": 3}'),
            r"was trained with observations Box\(-5.0, 5.0, \(9,\), float32\), .* has "
            r"Box\(-5.0, 5.0, \(10,\), float32\); give the keyword arguments",
        ),
        (("--algo", "a3c"), "--algo must be one of ppo, sac, td3, tqc, got 'a3c'"),
        (("--algo", "sac"), "cannot be loaded as a SAC"),
        (("--out", "{folder}/nowhere/own"), "there is no folder .*nowhere; name a file in a"),
    ],
)
def test_what_does_not_fit_is_said(saved, words, message, tmp_path):
    words = [word.replace("{folder}", str(tmp_path)) for word in words]
    usual = ("--env", DISPLACEMENT, "--out", tmp_path / "own", "--trust")
    done = run(saved[0], *usual, *words)
    assert done.exit_code == 2 and done.stdout == "" and not list(tmp_path.iterdir())
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, done.stderr
    assert re.search(message, done.stderr), done.stderr


def test_the_algorithm_is_read_off_the_zip(saved, tmp_path):
    assert algorithm_of(saved[0]) == "ppo"
    for name, kind in {"sac": SAC, "td3": TD3, "tqc": TQC}.items():
        kind("MlpPolicy", Small(), buffer_size=1, device="cpu").save(tmp_path / name)
        assert algorithm_of(tmp_path / f"{name}.zip") == name
    A2C("MlpPolicy", Small(), device="cpu").save(tmp_path / "a2c")
    said = "must be of one of ppo, sac, td3, tqc, its policy is of stable_baselines3.common"
    with pytest.raises(ExportError, match=said):
        algorithm_of(tmp_path / "a2c.zip")
    (tmp_path / "no.zip").write_bytes(b"PK")
    with pytest.raises(ExportError, match="must be a zip that Stable-Baselines3 saved"):
        algorithm_of(tmp_path / "no.zip")


def test_statistics_are_read_from_their_file(saved, tmp_path):
    env = gym.make(DISPLACEMENT, **json.loads(KWARGS))
    envs = VecNormalize(DummyVecEnv([lambda: env]), clip_obs=3.0)
    envs.obs_rms.mean[:] = np.linspace(-0.1, 0.1, 9)
    envs.save(str(tmp_path / "seen.pkl"))
    words = ("--env", DISPLACEMENT, "--env-kwargs", KWARGS, "--out", tmp_path / "own", "--trust")
    done = run(saved[0], *words, "--vecnormalize", tmp_path / "seen.pkl")
    assert done.exit_code == 0, done.stderr
    scaling = load_policy_file(tmp_path / "own").weights.scaling
    assert np.array_equal(scaling.mean, envs.obs_rms.mean) and scaling.clip == 3.0
    other = VecNormalize(DummyVecEnv([Small]))
    other.save(str(tmp_path / "other.pkl"))
    done = run(saved[0], *words, "--vecnormalize", tmp_path / "other.pkl")
    assert done.exit_code == 2 and "must be statistics that a VecNormalize saved" in done.stderr
