"""Every preset makes a learner; one that cannot be used is refused with what is wrong in it."""

import copy
from dataclasses import replace

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

import torch
import yaml
from stable_baselines3.common.vec_env import DummyVecEnv

from benchmarks.training.policy_batch import pressures_kpa
from benchmarks.training.preset import AVERAGE, PRESETS, WRAPPER, PresetError, load_preset
from benchmarks.training.run import learner
from benchmarks.training.train_policies import ordered
from pma_gym.envs import ENVIRONMENTS

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
SHIPPED = sorted(PRESETS.glob("*/*.yml"))


def made(preset, **settings):
    """A learner of a preset, on a single environment and with as little memory."""
    little = {"batch_size": 64} if preset.algorithm == "ppo" else {"buffer_size": 100}
    changed = replace(preset, settings={**preset.settings, **little, **settings})
    return learner(changed, DummyVecEnv([lambda: preset.env]), 0)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_shipped_preset_makes_a_learner(path):
    document = yaml.safe_load(path.read_text())
    # The form of rl-baselines3-zoo: ids of environments, settings, a wrapper with arguments.
    assert document and set(document) <= set(ENVIRONMENTS)
    for environment in document:
        preset = load_preset(path.parent.name, path.stem, environment)
        assert preset.wrapper["stations"] == "robust" and 150.0 <= min(pressures_kpa(preset))
        model = made(preset)
        assert type(model).__name__.lower() == path.stem
        first = float(preset.settings["learning_rate"].removeprefix("lin_"))
        assert [model.lr_schedule(left) for left in (1.0, 0.5, 0.0)] == [first, 0.5 * first, 0.0]


def test_text_of_the_zoo_is_read_as_the_zoo_reads_it():
    text = "dict(net_arch=dict(pi=[64], vf=[32, 32]), activation_fn=nn.ReLU, log_std_init=-1.5)"
    model = made(load_preset("increment", "ppo", DISPLACEMENT), policy_kwargs=text)
    evaluated = eval(text, {"nn": torch.nn, "dict": dict})
    assert model.policy_kwargs == evaluated
    kinds = [type(layer).__name__ for layer in model.policy.mlp_extractor.policy_net]
    assert kinds == ["Linear", "ReLU"]


def test_a_jump_of_the_regulator_never_breaks_the_rig():
    assert max(pressures_kpa(load_preset("increment", "ppo", DISPLACEMENT))) > 550
    late = load_preset("increment-late", "ppo", DISPLACEMENT)
    assert max(pressures_kpa(late)) == 550


def test_a_residual_on_a_controller_of_other_tasks_is_refused():
    with pytest.raises(PresetError, match="controller speed_pid: the task must be .* got isotonic"):
        ordered("ppo", "isotonic_exercise", "residual", 0, None, 1)
    form = ordered("ppo", "exercise", "residual", 0, 7, 1).preset
    assert form.env.adapter.base is not None and form.n_timesteps == 7


# -- refused ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (("incremnt", "ppo", DISPLACEMENT), r"no preset 'incremnt' for algo 'ppo': .*increment \("),
        (("increment", "pppo", DISPLACEMENT), r"for algo 'pppo': .*one of ppo, sac, td3, tqc"),
        (("increment", "ppo", "CartPole-v1"), r"CartPole-v1: the file has no such entry, it has"),
        (("nowhere/own.yml", "ppo", DISPLACEMENT), r"no preset 'nowhere/own.yml'"),
    ],
)
def test_unknown_names(asked, message):
    with pytest.raises(PresetError, match=message):
        load_preset(*asked)


def test_an_unknown_task():
    with pytest.raises(PresetError, match=r"task must be one of displacement, .*got 'walking'"):
        ordered("ppo", "walking", "increment", 0, None, 1)


OF_WRAPPER = ("env_wrapper", 0, WRAPPER)
WRONG = {
    r"unexpected keyword argument 'lerning_rate'": (("lerning_rate",), 0.1),
    r"Invalid learning rate: -1": (("learning_rate",), -1),
    r"n_timesteps missing": (("n_timesteps",), None),
    r"n_envs and n_timesteps must be at least 1.*got 0,": (("n_envs",), 0),
    r"env_wrapper must be a list of .* alone, got \['os.system'\]": (
        ("env_wrapper",),
        ["os.system"],
    ),
    r"missing 1 required positional argument: 'view'": (
        ("env_wrapper",),
        [{WRAPPER: {"form": {}}}],
    ),
    r"callback must be a list of .*WeightAverage": (("callback",), [{"os.system": {}}]),
    r"share must lie in 0 to 1": (("callback", 0, AVERAGE, "share"), 2),
    r"unexpected keyword argument 'arch'": (("policy_kwargs",), {"arch": [64]}),
    r"malformed node or string": (
        ("policy_kwargs",),
        "dict(net_arch=[64], activation_fn=__import__('os').system('touch OWNED'))",
    ),
    r"was never closed": (("policy_kwargs",), "dict("),
    r"policy must be MlpPolicy": (("policy",), "CnnPolicy"),
    r"unexpected keyword argument 'normalize'": (("normalize",), True),
    r"could not convert string to float: 'x'": (("noise_std",), "x"),
    r"view must be of kind tracking, got environment; .*train with a script of your own": (
        (*OF_WRAPPER, "view", "kind"),
        "environment",
    ),
    r"form base must be one of .*feedforward_pid.*got 'pidd'": (
        (*OF_WRAPPER, "form"),
        {"kind": "residual", "authority_v": 0.3, "base": "pidd"},
    ),
    r"no suite 'robst'.*did you mean robust\?": ((*OF_WRAPPER, "stations"), "robst"),
    r"'control_rate' \(did you mean 'control_rate_hz'\?\)": (
        (*OF_WRAPPER, "options"),
        {"control_rate": 50.0},
    ),
    r"reward_scale must be positive and finite, got -1": ((*OF_WRAPPER, "reward_scale"), -1),
    r"stations give the environment its model already": (
        (*OF_WRAPPER, "options"),
        {"model": "serres2008"},
    ),
    r"task must be one of .*got 'walking'": ((*OF_WRAPPER, "options"), {"task": "walking"}),
}


@pytest.fixture(scope="module")
def entry():
    text = (PRESETS / "increment" / "ppo.yml").read_text()
    return yaml.safe_load(text)[DISPLACEMENT]


@pytest.mark.parametrize("message", WRONG)
def test_a_wrong_entry_is_named(message, entry, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    place, value = WRONG[message]
    own = copy.deepcopy(entry)
    at = own
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    if value is None:
        del at[place[-1]]
    path = tmp_path / "own.yml"
    path.write_text(yaml.safe_dump({DISPLACEMENT: own}))
    with pytest.raises(PresetError, match=message) as caught:
        made(load_preset(str(path), "ppo", DISPLACEMENT))
    assert "own" in str(caught.value) and not (tmp_path / "OWNED").exists()


@pytest.mark.parametrize(
    "text",
    [
        "!!python/object/apply:os.system ['touch OWNED']",
        "!!python/name:os.system",
        "a: &a [*a",
        "- just a list",
        "",
    ],
)
def test_nothing_in_a_file_is_executed(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "own.yml"
    path.write_text(text)
    with pytest.raises(PresetError, match="own.yml"):
        load_preset(str(path), "ppo", DISPLACEMENT)
    assert not (tmp_path / "OWNED").exists()
