"""Presets: YAML in the form of rl-baselines3-zoo, checked, with nothing in it that executes.

A file `presets/NAME/ALGORITHM.yml` has the ids of environments as keys. What a policy sees and what
its action does are the arguments of the wrapper `benchmarks.training.piloted_env.PilotedEnv`, so
that the zoo trains the same thing.
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from controllers.form import Form
from controllers.view import View
from pma_gym.envs import ENVIRONMENTS

PRESETS = Path(__file__).with_name("presets")
"""Folder of the presets."""

ALGORITHMS = ("ppo", "sac", "td3", "tqc")
"""Algorithms of Stable-Baselines3 (tqc: of sb3-contrib)."""

WRAPPER = "benchmarks.training.piloted_env.PilotedEnv"
"""The only wrapper that a preset may name."""

NUMBERS = {
    "batch_size",
    "buffer_size",
    "clip_range",
    "ent_coef",
    "gae_lambda",
    "gamma",
    "gradient_steps",
    "learning_rate",
    "learning_starts",
    "max_grad_norm",
    "n_epochs",
    "n_steps",
    "policy_delay",
    "target_kl",
    "target_noise_clip",
    "target_policy_noise",
    "tau",
    "top_quantiles_to_drop_per_net",
    "train_freq",
    "vf_coef",
}
"""Settings of the algorithms that are numbers; "lin_0.001" falls linearly to 0, "auto" is SB3's."""

NETWORK = {"net_arch", "log_std_init", "n_critics", "n_quantiles"}
"""Settings of the network."""


class PresetError(ValueError):
    """A preset that cannot be used; the message names it and the mend."""


@dataclass(frozen=True)
class Preset:
    """What a policy is trained with.

    Attributes:
        name: of the preset.
        algorithm: one of `ALGORITHMS`.
        environment: id of the environment.
        view: what the policy sees.
        form: what its action does.
        stations: suite whose training stations it is trained on; empty for the nominal one.
        options: of the environment.
        environments: how many at once.
        steps: control steps in all.
        average_share: share of the training, at its end, whose weights are averaged.
        settings: of the algorithm.
        network: of its network.
        noise_std: standard deviation of the exploration's noise, where the algorithm needs one.
    """

    name: str
    algorithm: str
    environment: str
    view: View
    form: Form
    stations: str
    options: Mapping[str, Any]
    environments: int
    steps: int
    average_share: float
    settings: Mapping[str, Any]
    network: Mapping[str, Any]
    noise_std: float = 0.0

    @property
    def task(self) -> str:
        """Name of the task."""
        return str(self.options.get("task", ENVIRONMENTS[self.environment]))

    @property
    def rate_hz(self) -> float:
        """Control steps a second (Hz)."""
        return float(self.options.get("control_rate_hz", 100.0))

    def changed(self, **fields: Any) -> "Preset":
        """It with other values."""
        return replace(self, **fields)

    def to_json(self) -> dict[str, Any]:
        """All of it that moves a result."""
        return {
            "preset": self.name,
            "algorithm": self.algorithm,
            "environment": self.environment,
            "view": self.view.to_json(),
            "form": self.form.to_json(),
            "stations": self.stations,
            "options": dict(self.options),
            "environments": self.environments,
            "steps": self.steps,
            "average_share": self.average_share,
            "settings": dict(self.settings),
            "network": dict(self.network),
            "noise_std": self.noise_std,
        }


def preset_names() -> list[str]:
    """Names of the presets."""
    return sorted(path.name for path in PRESETS.iterdir() if path.is_dir())


def load_preset(name: str, algorithm: str, environment: str) -> Preset:
    """A preset by name, or from a YAML file of one's own.

    Args:
        name: one of `preset_names()`, or the path of a .yml file.
        algorithm: one of `ALGORITHMS`.
        environment: id of an environment.
    Raises:
        PresetError: there is none, or its file is not as it should be.
    """
    import yaml

    if algorithm not in ALGORITHMS:
        raise PresetError(
            f"algo must be one of {', '.join(ALGORITHMS)}, got {algorithm!r}"
            f"{_nearest(algorithm, ALGORITHMS)}"
        )
    path = Path(name) if name.endswith((".yml", ".yaml")) else PRESETS / name / f"{algorithm}.yml"
    if not path.is_file():
        names = preset_names()
        if name in names:
            has = ", ".join(sorted(p.stem for p in (PRESETS / name).glob("*.yml")))
            raise PresetError(f"preset {name!r} has no {algorithm}; it has {has}")
        raise PresetError(
            f"no preset {name!r}: there are {', '.join(names)}, or give the path of a .yml file"
            f"{_nearest(name, names)}"
        )
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise PresetError(f"{path} is no YAML: {error}") from error
    if not isinstance(document, Mapping) or environment not in document:
        known = ", ".join(map(str, document)) if isinstance(document, Mapping) else "nothing"
        raise PresetError(f"{path} has no entry for {environment}; it has {known}")
    try:
        return _parsed(
            path.stem if name.endswith(("yml", "yaml")) else name,
            algorithm,
            environment,
            dict(document[environment]),
        )
    except (TypeError, ValueError, KeyError) as error:
        raise PresetError(f"{path}, {environment}: {error}") from error


def _parsed(name: str, algorithm: str, environment: str, given: dict[str, Any]) -> Preset:
    if given.pop("policy", "MlpPolicy") != "MlpPolicy":
        raise ValueError("policy must be MlpPolicy: other networks cannot be shipped")
    if given.pop("normalize", False):
        raise ValueError("normalize is not supported: the view has scales of its own")
    wrapper = _wrapper(given.pop("env_wrapper"))
    average = _average(given.pop("callback", None))
    network = given.pop("policy_kwargs", {})
    if not isinstance(network, Mapping) or not set(network) <= NETWORK:
        raise ValueError(
            f"policy_kwargs must be a mapping of {', '.join(sorted(NETWORK))}, got {network!r}; "
            "text that the zoo would evaluate is not read here"
        )
    noise = given.pop("noise_std", 0.0)
    if given.pop("noise_type", "normal") != "normal":
        raise ValueError("noise_type must be normal")
    environments, steps = _whole(given, "n_envs"), _whole(given, "n_timesteps")
    for key, value in given.items():
        _check_setting(key, value)
    return Preset(
        name,
        algorithm,
        environment,
        View.of(wrapper.pop("view")),
        Form.of({"base": None} | wrapper.pop("form")),
        str(wrapper.pop("stations", "")),
        dict(wrapper.pop("options", {})),
        environments,
        steps,
        average,
        given,
        dict(network),
        float(noise),
    )


def _wrapper(given: object) -> dict[str, Any]:
    """Arguments of the wrapper."""
    if not isinstance(given, list) or len(given) != 1 or list(given[0]) != [WRAPPER]:
        raise ValueError(f"env_wrapper must be a list of {WRAPPER} alone, got {given!r}")
    arguments = dict(given[0][WRAPPER])
    strange = sorted(set(arguments) - {"view", "form", "stations", "options"})
    if strange or not {"view", "form"} <= set(arguments):
        raise ValueError(
            f"{WRAPPER} takes view, form, stations and options; got {', '.join(arguments)}"
        )
    return arguments


AVERAGE = "benchmarks.training.averaging.WeightAverage"
"""The only callback that a preset may name."""


def _average(given: object) -> float:
    if given is None:
        return 0.0
    if not isinstance(given, list) or len(given) != 1 or list(given[0]) != [AVERAGE]:
        raise ValueError(f"callback must be a list of {AVERAGE} alone, got {given!r}")
    share = given[0][AVERAGE]["share"]
    if not isinstance(share, float) or not 0.0 < share <= 1.0:
        raise ValueError(f"share of {AVERAGE} must lie above 0, up to 1, got {share!r}")
    return share


def _whole(given: dict[str, Any], name: str) -> int:
    value = given.pop(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or value != int(value):
        raise ValueError(f"{name} must be a whole number, got {value!r}")
    if value < 1:
        raise ValueError(f"{name} must be at least 1, got {value!r}")
    return int(value)


def _check_setting(key: str, value: object) -> None:
    if key not in NUMBERS:
        raise ValueError(f"unknown setting {key!r}{_nearest(key, NUMBERS)}")
    if isinstance(value, str):
        linear = value.removeprefix("lin_").removeprefix("auto_")
        if value == "auto" or linear != value and _is_number(linear):
            return
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f'{key} must be a number, "lin_" and a number, or "auto"; got {value!r}')


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _nearest(name: str, known: object) -> str:
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)  # type: ignore[call-overload]
    return f"; did you mean {close[0]!r}?" if close else ""
