"""Presets: YAML in the form of rl-baselines3-zoo, checked, with nothing in it that executes.

A file `presets/NAME/ALGORITHM.yml` has the ids of environments as keys. What a policy sees and what
its action does are the arguments of the wrapper `benchmarks.training.policy_env.PilotedEnv`, so
that the zoo trains the same thing.
"""

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.training.configuration.settings import (
    mapping,
    nearest,
    network,
    real,
    setting,
    whole,
)
from benchmarks.training.stations import training_recipe
from controllers.policies.adapter import ActionMapping, base_of
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.documents import is_file, read_yaml
from pma_gym.engine.options import parse_options, parse_task
from pma_gym.envs import ENVIRONMENTS

PRESETS = Path(__file__).parents[1] / "presets"
"""Folder of the presets."""

ALGORITHMS = ("ppo", "sac", "td3", "tqc")
"""Algorithms of Stable-Baselines3 (tqc: of sb3-contrib)."""

WRAPPER = "benchmarks.training.policy_env.PilotedEnv"
"""The only wrapper that a preset may name."""

WRAPPED = {"view": True, "form": True, "stations": False, "options": False, "reward_scale": False}
"""Its arguments, and whether they must be there."""

AVERAGE = "benchmarks.training.averaging.WeightAverage"
"""The only callback that a preset may name."""

AVERAGED = {"share": True}
"""Its arguments, and whether they must be there."""


class PresetError(ValueError):
    """A preset that cannot be used; the message names it and the fix."""


@dataclass(frozen=True)
class Preset:
    """Configuration of a training.

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
        reward_scale: factor on the rewards that it learns from.
    """

    name: str
    algorithm: str
    environment: str
    view: ObservationSpec
    form: ActionMapping
    stations: str
    options: Mapping[str, Any]
    environments: int
    steps: int
    average_share: float
    settings: Mapping[str, Any]
    network: Mapping[str, Any]
    noise_std: float = 0.0
    reward_scale: float = 1.0

    @property
    def task(self) -> str:
        """Name of the task."""
        return str(self.options.get("task", ENVIRONMENTS[self.environment]))

    @property
    def rate_hz(self) -> float:
        """Control steps a second (Hz)."""
        return float(self.options.get("control_rate_hz", 100.0))

    def changed(self, **fields: Any) -> "Preset":
        """Return a copy with other values."""
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
            "reward_scale": self.reward_scale,
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
    if algorithm not in ALGORITHMS:
        raise PresetError(
            f"algo must be one of {', '.join(ALGORITHMS)}, got {algorithm!r}"
            f"{nearest(algorithm, ALGORITHMS)}"
        )
    path = Path(name) if name.endswith((".yml", ".yaml")) else PRESETS / name / f"{algorithm}.yml"
    if not is_file(path):
        names = preset_names()
        if name in names:
            has = ", ".join(sorted(p.stem for p in (PRESETS / name).glob("*.yml")))
            raise PresetError(f"preset {name!r} has no {algorithm}; it has {has}")
        raise PresetError(
            f"no preset {name!r}: there are {', '.join(names)}, or give the path of a .yml file"
            f"{nearest(name, names)}"
        )
    try:
        document = read_yaml(path, finite=False)
    except ValueError as error:
        raise PresetError(str(error)) from error
    if not isinstance(document, Mapping) or environment not in document:
        known = ", ".join(map(str, document)) if isinstance(document, Mapping) else "nothing"
        raise PresetError(f"{path} has no entry for {environment}; it has {known}")
    try:
        return _parsed(
            path.stem if name.endswith(("yml", "yaml")) else name,
            algorithm,
            environment,
            document[environment],
        )
    except (TypeError, ValueError, KeyError) as error:
        raise PresetError(f"{path}, {environment}: {error}") from error


def _parsed(name: str, algorithm: str, environment: str, entry: object) -> Preset:
    given = mapping("the entry", entry)
    for key in ("env_wrapper", "n_envs", "n_timesteps"):
        if key not in given:
            raise ValueError(f"{key} is missing")
    if given.pop("policy", "MlpPolicy") != "MlpPolicy":
        raise ValueError("policy must be MlpPolicy: other networks cannot be shipped")
    if given.pop("normalize", False):
        raise ValueError("normalize is not supported: the view has scales of its own")
    if given.pop("noise_type", "normal") != "normal":
        raise ValueError("noise_type must be normal")
    wrapper = _arguments("env_wrapper", given.pop("env_wrapper"), WRAPPER, WRAPPED)
    average = _average(given.pop("callback", None))
    layers, noise = (
        network(given.pop("policy_kwargs", {})),
        real("noise_std", given.pop("noise_std", 0.0)),
    )
    environments, steps = (whole(key, given.pop(key)) for key in ("n_envs", "n_timesteps"))
    preset = Preset(
        name,
        algorithm,
        environment,
        ObservationSpec.of(mapping("view", wrapper["view"])),
        ActionMapping.of({"base": None} | mapping("form", wrapper["form"])),
        str(wrapper.get("stations", "")),
        mapping("options", wrapper.get("options", {})),
        environments,
        steps,
        average,
        {key: setting(algorithm, key, value) for key, value in given.items()},
        layers,
        float(noise),
        _scale(wrapper.get("reward_scale", 1.0)),
    )
    _check_environment(preset)
    return preset


def _check_environment(preset: Preset) -> None:
    """Refuse what no environment could be made of, before anything is made."""
    options = {key: value for key, value in preset.options.items() if key != "task"}
    doubled = sorted({"model", "randomisation"} & set(options))
    if preset.stations and doubled:
        raise ValueError(
            f"stations give the environment its {' and '.join(doubled)} already: leave out the "
            "option or the stations"
        )
    parse_task(preset.task, parse_options(options))
    if preset.stations:
        training_recipe(preset.stations)
    if preset.view.kind != "tracking":
        raise ValueError(
            f"view must be of kind tracking, got {preset.view.kind}; on the environment's own view "
            "train with a script of your own, see docs/train-a-policy.md"
        )
    if preset.form.base:
        base_of(preset.form)


def _arguments(what: str, given: object, only: str, known: Mapping[str, bool]) -> dict[str, Any]:
    """Arguments of the only wrapper or callback that a preset may name."""
    if (
        not isinstance(given, list)
        or len(given) != 1
        or not isinstance(given[0], Mapping)
        or list(given[0]) != [only]
    ):
        raise ValueError(f"{what} must be a list of {only} alone, got {reprlib.repr(given)}")
    arguments = mapping(only, given[0][only])
    needed = {key for key, must in known.items() if must}
    if not needed <= set(arguments) <= set(known):
        raise ValueError(
            f"{only} takes {', '.join(known)}, of which {', '.join(sorted(needed))} must be there; "
            f"got {', '.join(map(str, arguments)) or 'nothing'}"
        )
    return arguments


def _scale(given: object) -> float:
    scale = real(f"reward_scale of {WRAPPER}", given)
    if scale <= 0.0:
        raise ValueError(f"reward_scale of {WRAPPER} must be positive, got {reprlib.repr(given)}")
    return float(scale)


def _average(given: object) -> float:
    if given is None:
        return 0.0
    share = real(f"share of {AVERAGE}", _arguments("callback", given, AVERAGE, AVERAGED)["share"])
    if not 0.0 < share <= 1.0:
        raise ValueError(f"share of {AVERAGE} must lie above 0, up to 1, got {share!r}")
    return float(share)
