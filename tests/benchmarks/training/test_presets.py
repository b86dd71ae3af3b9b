"""Every preset makes a learner; one that cannot be used is refused with what is wrong in it."""

import copy
from dataclasses import replace

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("safetensors")

import torch
import yaml
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.training.configuration.preset import (
    ALGORITHMS,
    PRESETS,
    PresetError,
    load_preset,
)
from benchmarks.training.configuration.settings import network
from benchmarks.training.environments import pressures_kpa
from benchmarks.training.learner import learner
from benchmarks.training.policy_env import PilotedEnv
from benchmarks.training.policy_export.product import station_of
from benchmarks.training.train_policies import ordered
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.envs import ENVIRONMENTS

DISPLACEMENT = "pma_gym/IsokineticDisplacement-v0"
ROTATION = "pma_gym/IsokineticRotation-v0"
WRAPPER = "benchmarks.training.policy_env.PilotedEnv"
AVERAGE = "benchmarks.training.averaging.WeightAverage"
SHIPPED = sorted(PRESETS.glob("*/*.yml"))


class Spaces(VecEnv):
    """An environment of which there is nothing but its spaces: stations take long to draw."""

    def __init__(self, preset):
        from gymnasium import spaces

        self.render_mode = None
        entries = len(preset.view.rows(station_of(preset), preset.form.base))
        seen, action = spaces.Box(-5.0, 5.0, (entries,)), spaces.Box(-1.0, 1.0, (1,))
        super().__init__(preset.environments, seen, action)

    def refuse(self, *_, **__):
        raise NotImplementedError

    reset = step_async = step_wait = close = set_attr = env_method = refuse  # type: ignore[assignment]

    def get_attr(self, attr_name, indices=None):
        return [getattr(self, attr_name, None)] * self.num_envs

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * self.num_envs


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_shipped_preset_makes_a_learner(path):
    document = yaml.safe_load(path.read_text())
    # The form of rl-baselines3-zoo: ids of environments, settings, a wrapper with arguments.
    assert document and set(document) <= set(ENVIRONMENTS)
    for environment in document:
        preset = load_preset(path.parent.name, path.stem, environment)
        assert preset.stations == "robust" and 150.0 <= min(pressures_kpa(preset))
        model = learner(preset.changed(settings={**preset.settings, **_little(preset)}),
                        Spaces(preset), seed=0)  # fmt: skip
        assert type(model).__name__.lower() == path.stem
        # It falls over the whole training, not over each of its legs.
        rate = model.lr_schedule
        first = rate(1.0)
        assert first == float(preset.settings["learning_rate"].removeprefix("lin_"))
        model.num_timesteps = preset.steps // 2
        assert rate(1.0) == pytest.approx(0.5 * first)
        model.num_timesteps = 2 * preset.steps
        assert rate(1.0) == 0.0


def _little(preset):
    return {"buffer_size": 2000} if "buffer_size" in preset.settings else {}


def test_the_zoo_makes_the_same_environment():
    import gymnasium as gym

    text = (PRESETS / "increment" / "ppo.yml").read_text()
    arguments = yaml.safe_load(text)[DISPLACEMENT]["env_wrapper"][0][WRAPPER]
    env = PilotedEnv(gym.make(DISPLACEMENT), **(arguments | {"stations": ""}))
    preset = load_preset("increment", "ppo", DISPLACEMENT)
    assert env.observation_space.shape == (
        len(ObservationSpec(preview=6, history=6).rows(env.rig.station)),
    )
    assert env.pilot.view == preset.view and env.pilot.form == preset.form


def test_text_of_the_zoo_is_read_as_the_zoo_reads_it():
    text = "dict(net_arch=dict(pi=[64], vf=[32, 32]), activation_fn=nn.ReLU, log_std_init=-1.5)"
    evaluated = eval(text, {"nn": torch.nn, "dict": dict})
    assert evaluated.pop("activation_fn") is torch.nn.ReLU
    assert network(text) == evaluated | {"activation_fn": "nn.ReLU"}
    preset = load_preset("increment", "ppo", DISPLACEMENT)
    model = learner(replace(preset, network=network(text)), Spaces(preset), seed=0)
    kinds = [type(layer).__name__ for layer in model.policy.mlp_extractor.policy_net]
    assert kinds == ["Linear", "ReLU"]


def test_a_jump_of_the_regulator_never_breaks_the_rig():
    assert max(pressures_kpa(load_preset("increment", "ppo", DISPLACEMENT))) > 550
    late = load_preset("increment-late", "ppo", DISPLACEMENT)
    assert max(pressures_kpa(late)) == 550


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_residual_on_a_controller_of_other_tasks_is_refused(algorithm):
    with pytest.raises(PresetError, match="speed_pid, which is for tasks of kind isokinetic, got"):
        ordered(algorithm, "isotonic_exercise", "residual", 0, None, "cpu", 1, 0)
    assert ordered(algorithm, "exercise", "residual", 0, None, "cpu", 1, 0).preset.form.base


# -- refused ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "asked, message",
    [
        (("incremnt", "ppo", DISPLACEMENT), r"no preset 'incremnt': .*did you mean 'increment'\?"),
        (("increment", "pppo", DISPLACEMENT), r"algo must be one of ppo, .*did you mean 'ppo'\?"),
        (("increment", "ppo", "CartPole-v1"), r"no entry for CartPole-v1; it has pma_gym/Isok"),
        (("nowhere/own.yml", "ppo", DISPLACEMENT), r"no preset 'nowhere/own.yml'"),
    ],
)
def test_unknown_names(asked, message):
    with pytest.raises(PresetError, match=message):
        load_preset(*asked)


def test_an_unknown_task_and_an_absent_device():
    with pytest.raises(PresetError, match=r"task must be one of displacement, .*got 'walking'"):
        ordered("ppo", "walking", "increment", 0, None, "cpu", 1, 0)
    if not torch.cuda.is_available():
        with pytest.raises(PresetError, match=r"device 'cuda' cannot be used: .*leave --device"):
            ordered("ppo", "displacement", "increment", 0, None, "cuda", 1, 0)
    with pytest.raises(PresetError, match=r"device 'gpu' cannot be used"):
        ordered("ppo", "displacement", "increment", 0, None, "gpu", 1, 0)


OF_WRAPPER = ("env_wrapper", 0, WRAPPER)
WRONG = {
    r"ppo has no setting 'lerning_rate'; did you mean 'learning_rate'\?": (("lerning_rate",), 0.1),
    r"ppo has no setting 'tau'": (("tau",), 0.1),
    r"got '1e-3'; YAML takes it for text: write 0.001": (("learning_rate",), "1e-3"),
    r"learning_rate must be a finite number, got nan": (("learning_rate",), float("nan")),
    r"learning_rate must not be negative, got -1": (("learning_rate",), -1),
    r'"lin_" and a number, got \'lin_nan\'': (("learning_rate",), "lin_nan"),
    r"n_steps must be a number, got 'lin_64'": (("n_steps",), "lin_64"),
    r"n_steps must be a whole number from 1 up, got 64.5": (("n_steps",), 64.5),
    r"ent_coef must be a number, got 'auto'": (("ent_coef",), "auto"),
    r"gamma must lie in 0 to 1, got 1.5": (("gamma",), 1.5),
    r"n_envs must be a finite number, got inf": (("n_envs",), float("inf")),
    r"n_envs must be a whole number from 1 up, got 0": (("n_envs",), 0),
    r"n_timesteps is missing": (("n_timesteps",), None),
    r"env_wrapper is missing": (("env_wrapper",), None),
    r"env_wrapper must be a list of benchmarks.*alone, got \['os.system'\]": (
        ("env_wrapper",),
        ["os.system"],
    ),
    r"PilotedEnv takes view, form, .*must be there; got form": (
        ("env_wrapper",),
        [{WRAPPER: {"form": {}}}],
    ),
    r"callback must be a list of .*WeightAverage alone": (("callback",), [{"os.system": {}}]),
    r"share of .*WeightAverage must lie above 0, up to 1, got 2": (
        ("callback", 0, AVERAGE, "share"),
        2,
    ),
    r"policy_kwargs must be a mapping of activation_fn, .*got \{'arch': \[64\]\}": (
        ("policy_kwargs",),
        {"arch": [64]},
    ),
    r"policy_kwargs may have dict.*got \"__import__\('os'\).system\('ls'\)\"; nothing is": (
        ("policy_kwargs",),
        "dict(net_arch=[64], activation_fn=__import__('os').system('ls'))",
    ),
    r"policy_kwargs names net_arch twice": (
        ("policy_kwargs",),
        "dict(net_arch=[64], net_arch=[32])",
    ),
    r"net_arch must name pi, qf, vf alone, got \{'foo': \[3\]\}": (
        ("policy_kwargs",),
        "dict(net_arch=dict(foo=[3]))",
    ),
    r"log_std_init must be a finite number, got inf": (
        ("policy_kwargs",),
        "dict(log_std_init=1e999)",
    ),
    r"policy_kwargs is no Python text \(.*got 'dict\('": (("policy_kwargs",), "dict("),
    r"policy_kwargs must be a dict\(...\), got '\[64\]'": (("policy_kwargs",), "[64]"),
    r"activation_fn must be one of nn.ReLU, nn.Tanh, got 'relu'": (
        ("policy_kwargs", "activation_fn"),
        "relu",
    ),
    r"net_arch must be a list such as \[64, 64\], got 64": (("policy_kwargs", "net_arch"), 64),
    r"policy must be MlpPolicy": (("policy",), "CnnPolicy"),
    r"normalize is not supported": (("normalize",), True),
    r"noise_std must be a finite number, got 'x'": (("noise_std",), "x"),
    r"view must be a mapping of names to values, got 'tracking'": (
        (*OF_WRAPPER, "view"),
        "tracking",
    ),
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
    r"reward_scale of .*PilotedEnv must be positive, got -1": ((*OF_WRAPPER, "reward_scale"), -1),
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
def test_a_wrong_entry_is_named(message, entry, tmp_path):
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
        load_preset(str(path), "ppo", DISPLACEMENT)
    assert str(caught.value).startswith(f"{path}, {DISPLACEMENT}: ")


def test_a_file_of_ones_own_is_named_after_itself(entry, tmp_path):
    path = tmp_path / "mine.yml"
    path.write_text(yaml.safe_dump({DISPLACEMENT: entry | {"n_steps": 64.0}}))
    preset = load_preset(str(path), "ppo", DISPLACEMENT)
    assert preset.name == "mine" and isinstance(preset.settings["n_steps"], int)


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
