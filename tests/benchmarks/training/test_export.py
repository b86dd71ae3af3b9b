"""What is exported does what the model does, and what a policy file does not hold is refused."""

import base64
import json
import re
import subprocess
import sys
import zipfile

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

import cloudpickle
import torch
from gymnasium import spaces
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.training.export import CONVERT, weights_from_state
from benchmarks.training.onnx_file import onnx_bytes
from controllers.policies.adapter import ActionMapping
from controllers.policies.network import Network
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import load_policy_file
from controllers.policy import Policy
from pma_gym.envs import StationInfo
from pma_gym.plant.model import load_model
from pma_gym.tasks import TASKS
from tests.controllers.policies.test_network import drawn_policy

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
AGREEMENT = 1e-6
"""Largest difference of two actions of -1 to 1 (5 uV of 0-10 V), but for rounding."""

LEARNING = {"learning_starts": 16, "buffer_size": 500, "batch_size": 16}
MODELS = {
    "ppo": (PPO, {"n_steps": 64, "batch_size": 32}, nn.Tanh),
    "ppo_relu": (PPO, {"n_steps": 64, "batch_size": 32}, nn.ReLU),
    "ppo_default": (PPO, {"n_steps": 64, "batch_size": 32}, None),
    "sac": (SAC, LEARNING, None),
    "sac_tanh": (SAC, LEARNING, nn.Tanh),
    "td3": (TD3, LEARNING, None),
    "td3_tanh": (TD3, LEARNING, nn.Tanh),
    "tqc": (TQC, LEARNING, nn.ReLU),
}


class Small(gym.Env):
    """An environment of nothing: noise to see, and an action that had better be small."""

    def __init__(self, seen=None, action=None):
        env = gym.make(DISPLACEMENT, preview=2)
        self.observation_space = seen or env.observation_space
        self.action_space = action or env.action_space

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
    arch = {"activation_fn": activation, "net_arch": [32, 32]} if activation else {}
    env = Small() if env is None else env
    model = kind("MlpPolicy", env, policy_kwargs=arch, seed=0, device="cpu", **options)
    return model.learn(steps)


def drawn_observations(entries):
    """Observations of all sizes that entries have, from small to their bound of 5."""
    rows = (
        np.random.default_rng(0).normal(size=(512, entries)) * np.geomspace(0.01, 5, 512)[:, None]
    )
    return np.clip(rows, -5.0, 5.0).astype(np.float32)


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


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


def exported(model, folder, *words):
    """The policy that the command makes of a model, or its message."""
    model.save(folder / "model.zip")
    kwargs = ("--env", DISPLACEMENT, "--env-kwargs", '{"preview": 2}')
    done = run(folder / "model.zip", *kwargs, "--out", folder / "own", *words)
    if done.exit_code:
        assert done.exit_code == 2 and done.stdout == "" and not list(folder.glob("own*"))
        assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, done.stderr
        return done.stderr
    return load_policy_file(folder / "own")


@pytest.mark.parametrize("name", MODELS)
def test_the_actions_are_the_models_own(name, tmp_path):
    model = learned(name)
    rows = drawn_observations(9)
    theirs, _ = model.predict(rows, deterministic=True)
    policy = exported(model, tmp_path)
    ours = Network(policy.weights).many(rows)
    assert np.max(np.abs(ours - theirs)) < AGREEMENT
    assert np.ptp(ours) > 0.01
    assert policy.training["algorithm"] == name.partition("_")[0]


def test_with_the_statistics_of_vecnormalize(tmp_path):
    envs = VecNormalize(DummyVecEnv([Small]), clip_obs=2.0)
    model = learned("ppo", envs)
    envs.training = False
    envs.save(str(tmp_path / "vecnormalize.pkl"))
    # What is pickled is refused, and the program that the message has makes what is not.
    said = exported(model, tmp_path, "--vecnormalize", tmp_path / "vecnormalize.pkl")
    assert "is a pickle, which may run code" in said and f'python -c "{CONVERT}"' in said
    subprocess.run([sys.executable, "-c", CONVERT], cwd=tmp_path, check=True)
    policy = exported(model, tmp_path, "--vecnormalize", tmp_path / "vecnormalize.npz")
    rows = drawn_observations(9)
    theirs, _ = model.predict(envs.normalize_obs(rows), deterministic=True)
    assert np.max(np.abs(Network(policy.weights).many(rows) - theirs)) < AGREEMENT
    np.savez(tmp_path / "other.npz", mean=[0.0], variance=[1.0], epsilon=1e-8, clip=2.0)
    (tmp_path / "again").mkdir()
    said = exported(model, tmp_path / "again", "--vecnormalize", tmp_path / "other.npz")
    assert "they are of 1 entries" in said


def test_training_on_does_not_change_what_was_exported():
    model = learned("sac")
    weights = weights_from_state("sac", model.policy.state_dict(), "ReLU")
    before = Network(weights).many(drawn_observations(9))
    model.learn(64)
    assert np.array_equal(Network(weights).many(drawn_observations(9)), before)


def test_a_users_own_model_drives_as_a_policy_as_it_did_as_an_agent(tmp_path):
    model = learned("ppo", gym.make(DISPLACEMENT, preview=2, pressure_kpa=300), steps=64)
    model.save(tmp_path / "mine.v2.zip")
    out = tmp_path / "own-100hz"
    words = ("--env", DISPLACEMENT, "--env-kwargs", '{"preview": 2}')
    done = run(tmp_path / "mine.v2.zip", *words, "--out", out)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.split() == [f"{out}.json", f"{out}.safetensors"]
    policy = Policy(out)
    file = policy.file
    assert (file.view, file.form) == (
        ObservationSpec("environment", 2, 0),
        ActionMapping("direct", 5.0),
    )
    assert (file.training["steps"], file.task) == (64, "displacement")
    env = gym.make(DISPLACEMENT, preview=2).unwrapped
    observation, _ = env.reset(seed=3, options={"pressure_kpa": 300})
    policy.reset(env.reference, env.station)
    for _ in range(100):
        action, _ = model.predict(observation, deterministic=True)
        volts = policy.act(env.measurement, env.time)
        assert abs(volts - (5.0 + 5.0 * float(action[0]))) < 1e-5
        observation, *_ = env.step(action)


def test_onnx_beside_it(tmp_path):
    pytest.importorskip("onnx")
    policy = exported(PPO("MlpPolicy", Small(), device="cpu"), tmp_path, "--to", "onnx")
    assert (tmp_path / "own.onnx").read_bytes() == onnx_bytes(policy)


# -- refused ---------------------------------------------------------------------------------------


class Doubled(FlattenExtractor):
    """A features extractor without parameters."""

    def forward(self, observations):
        return 2.0 * super().forward(observations)


def _in(seen=None, action=None, kind=PPO, policy="MlpPolicy", **options):
    return lambda: kind(policy, Small(seen, action), device="cpu", **options)


IMAGE = spaces.Box(0, 255, (3, 36, 36), np.uint8)
REFUSED = {
    r"trained with the observation_space .*None": _in(
        spaces.Dict({"a": spaces.Box(-1.0, 1.0, (2,))}), policy="MultiInputPolicy"
    ),
    r"trained with the observation_space ": _in(IMAGE, policy="CnnPolicy"),
    r"trained with the observation_space .*; give the keyword arguments": _in(
        spaces.Box(-5.0, 5.0, (8,))
    ),
    r"trained with the action_space .*None": _in(action=spaces.Discrete(3)),
    r"trained with the action_space .*-1. -1.": _in(action=spaces.Box(-1.0, 1.0, (2,))),
    r"trained with the action_space .*10.": _in(action=spaces.Box(0.0, 10.0, (1,)), kind=SAC),
    r"this one has use_sde": _in(use_sde=True),
    r"activation_fn must be Tanh or ReLU, the model has ELU": _in(
        policy_kwargs={"activation_fn": nn.ELU}
    ),
    r"the policy of .* is of sb3_contrib.*recurrent": _in(
        kind=RecurrentPPO, policy="MlpLstmPolicy"
    ),
    r"only an MlpPolicy of ppo, sac, td3, tqc .* is of stable_baselines3.common": _in(kind=A2C),
    r"or a features_extractor_class": _in(policy_kwargs={"features_extractor_class": Doubled}),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_a_policy_file_does_not_hold_is_refused(message, tmp_path):
    assert re.search(message, exported(REFUSED[message](), tmp_path))


def test_weights_that_are_no_numbers_are_refused(tmp_path):
    model = _in()()
    with torch.no_grad():
        model.policy.action_net.bias[0] = np.nan
    assert "must have finite weights" in exported(model, tmp_path)


class Runs:
    def __reduce__(self):
        return exec, ("raise SystemExit('it ran')",)


def test_nothing_in_a_zip_executes(tmp_path):
    model = _in()()
    model.save(tmp_path / "model.zip")
    rows = drawn_observations(9)
    with zipfile.ZipFile(tmp_path / "model.zip") as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    data = json.loads(content["data"])
    code = base64.b64encode(cloudpickle.dumps(Runs())).decode()
    for entry in data.values():
        if isinstance(entry, dict) and ":serialized:" in entry:
            entry[":serialized:"] = code
    torch.save({"action_net.weight": Runs()}, tmp_path / "runs.pth")
    words = ("--env", DISPLACEMENT, "--env-kwargs", '{"preview": 2}', "--out", tmp_path / "own")
    for changes, code in (
        ({"data": json.dumps(data).encode()}, 0),
        ({"policy.pth": (tmp_path / "runs.pth").read_bytes()}, 2),
    ):
        with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
            for name, member in {**content, **changes}.items():
                archive.writestr(name, member)
        done = run(tmp_path / "model.zip", *words)
        assert done.exit_code == code, done.stderr
    assert "must be a zip that Stable-Baselines3 saved" in done.stderr
    ours = Network(load_policy_file(tmp_path / "own").weights).many(rows)
    assert np.max(np.abs(ours - model.predict(rows, deterministic=True)[0])) < AGREEMENT


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
        (("--out", "{folder}/nowhere/own"), "there is no folder .*nowhere; name a file in a"),
        ((), "must be a zip that Stable-Baselines3 saved"),
    ],
)
def test_what_does_not_fit_is_said(words, message, tmp_path):
    (tmp_path / "no.zip").write_bytes(b"PK")
    words = [word.replace("{folder}", str(tmp_path)) for word in words]
    usual = ("--env", DISPLACEMENT, "--out", tmp_path / "own")
    done = run(tmp_path / "no.zip", *usual, *words)
    assert done.exit_code == 2 and done.stdout == "" and len(list(tmp_path.iterdir())) == 1
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, done.stderr
    assert re.search(message, done.stderr), done.stderr
