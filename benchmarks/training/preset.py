"""Presets: YAML in the form of rl-baselines3-zoo, with nothing in it that executes.

A file `presets/NAME/ALGORITHM.yml` has the ids of environments as keys. What a policy sees and what
its action does are the arguments of the wrapper `benchmarks.training.policy_env.PolicyEnv`, so that
the zoo trains the same thing. Hyperparameters go to Stable-Baselines3 unchanged, which checks them.
"""

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.training.policy_env import PolicyEnv
from pma_gym.documents import is_file, read_yaml
from pma_gym.envs import ENVIRONMENTS, PMAEnv

PRESETS = Path(__file__).parent / "presets"
"""Folder of the presets."""

ALGORITHMS = ("ppo", "sac", "td3", "tqc")
"""Algorithms of Stable-Baselines3 (tqc: of sb3-contrib)."""

WRAPPER = "benchmarks.training.policy_env.PolicyEnv"
"""The only wrapper that a preset may name."""

AVERAGE = "benchmarks.training.run.WeightAverage"
"""The only callback that a preset may name."""


class PresetError(ValueError):
    """A preset that cannot be used; the message names it and the fix."""


@dataclass(frozen=True)
class Preset:
    """Configuration of a training.

    Attributes:
        name: of the preset.
        algorithm: one of `ALGORITHMS`.
        environment: id of the environment.
        wrapper: arguments of its `PolicyEnv`.
        n_envs: how many environments at once.
        n_timesteps: control steps in all.
        average_share: share of the training over which weights are averaged; 0 for none.
        noise_std: standard deviation of the exploration's noise, where the algorithm needs one.
        settings: of the algorithm, `policy_kwargs` among them.
    """

    name: str
    algorithm: str
    environment: str
    wrapper: Mapping[str, Any]
    n_envs: int
    n_timesteps: int
    average_share: float
    noise_std: float
    settings: Mapping[str, Any]

    @cached_property
    def env(self) -> PolicyEnv:
        """A single environment of it."""
        return PolicyEnv(PMAEnv(ENVIRONMENTS[self.environment]), **self.wrapper)

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.env.rig.task.name

    @property
    def options(self) -> dict[str, Any]:
        """Options of the environment, the task left out."""
        options: Mapping[str, Any] = self.wrapper.get("options") or {}
        return {key: value for key, value in options.items() if key != "task"}


def load_preset(
    name: str, algorithm: str, environment: str, task: str = "", steps: int | None = None
) -> Preset:
    """A preset by name, or from a YAML file of one's own.

    Args:
        name: a folder of `PRESETS`, or the path of a .yml file.
        algorithm: one of `ALGORITHMS`.
        environment: id of an environment.
        task: name of its task, where the environment has several.
        steps: control steps in place of the preset's.
    Raises:
        PresetError: there is none, or no environment can be made of it.
    """
    own = name.endswith((".yml", ".yaml"))
    path = Path(name) if own else PRESETS / name / f"{algorithm}.yml"
    if algorithm not in ALGORITHMS or not is_file(path):
        pairs = sorted(f"{path.parent.name} ({path.stem})" for path in PRESETS.glob("*/*.yml"))
        raise PresetError(
            f"no preset {name!r} for algo {algorithm!r}: there are {', '.join(pairs)}; or give the "
            f"path of a .yml file and one of {', '.join(ALGORITHMS)}"
        )
    try:
        document = read_yaml(path, finite=False)
        if not isinstance(document, Mapping) or not isinstance(document.get(environment), Mapping):
            raise ValueError(f"the file has no such entry, it has {reprlib.repr(document)}")
        entry = dict(document[environment]) | ({"n_timesteps": steps} if steps else {})
        preset = _parsed(path.stem if own else name, algorithm, environment, entry, task)
        _ = preset.env
    # Values of any kind go to constructors, which may raise anything.
    except Exception as error:
        raise PresetError(f"{path}, {environment}: {error}") from error
    return preset


def _parsed(
    name: str, algorithm: str, environment: str, entry: dict[str, Any], task: str
) -> Preset:
    if missing := {"env_wrapper", "n_envs", "n_timesteps"} - set(entry):
        raise ValueError(f"{', '.join(sorted(missing))} missing; see {PRESETS} for examples")
    if entry.pop("policy", "MlpPolicy") != "MlpPolicy":
        raise ValueError("policy must be MlpPolicy: a policy file holds no other network")
    if entry.pop("noise_type", "normal") != "normal":
        raise ValueError("noise_type must be normal")
    wrapper = _arguments("env_wrapper", entry.pop("env_wrapper"), WRAPPER)
    if task:
        wrapper["options"] = {**wrapper.get("options", {}), "task": task}
    callback = entry.pop("callback", None)
    share = _arguments("callback", callback, AVERAGE)["share"] if callback else 0.0
    count, steps = int(entry.pop("n_envs")), int(entry.pop("n_timesteps"))
    noise = float(entry.pop("noise_std", 0.0))
    if count < 1 or steps < 1 or not 0.0 <= share <= 1.0 or not 0.0 <= noise < 10.0:
        raise ValueError(
            "n_envs and n_timesteps must be at least 1, share must lie in 0 to 1, noise_std in "
            f"0 to 10; got {count}, {steps}, {share!r} and {noise:g}"
        )
    return Preset(name, algorithm, environment, wrapper, count, steps, share, noise, entry)


def _arguments(key: str, value: object, path: str) -> dict[str, Any]:
    """Arguments of the only wrapper or callback that a preset may name."""
    match value:
        case [{**one}] if list(one) == [path] and isinstance(one[path], Mapping):
            return dict(one[path])
    raise ValueError(
        f"{key} must be a list of {path} with its arguments alone, got {reprlib.repr(value)}"
    )
