"""Controllers for elsewhere: networks of Stable-Baselines3 as policies, and all of them as C.

`python -m benchmarks export` reads a zip's JSON and its tensors, as weights only: nothing of it is
unpickled, so nothing in it executes.
"""

import json
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from benchmarks.training.c_controllers import pid_source, policy_source
from benchmarks.training.onnx_file import ExportError, onnx_bytes
from controllers.design.designs import task_kind
from controllers.policies.adapter import MIDDLE_V, ActionMapping
from controllers.policies.network import Layer, Scaling, Weights
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import (
    LARGEST_MIB,
    PolicyFile,
    load_policy_file,
    policy_pair,
    save_policy_file,
)
from pma_gym.documents import parse_json
from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.export.c_plant import identifier
from pma_gym.files import check_output, replace_files
from pma_gym.limits import check_limit, limit


class Actor(NamedTuple):
    """The network that computes an MlpPolicy's deterministic action.

    Attributes:
        module: of the policy's class.
        tensors: beginnings of the names of its tensors.
        activation: between its layers, if `policy_kwargs` name none.
        output: what keeps its actions in -1..1.
    """

    module: str
    tensors: tuple[str, ...]
    activation: str
    output: str


_LATENT = ("actor.latent_pi.", "actor.mu.")
_ON_POLICY = ("mlp_extractor.policy_net.", "action_net.")

ACTORS = {
    "ppo": Actor("stable_baselines3.common.policies", _ON_POLICY, "Tanh", "clip"),
    "sac": Actor("stable_baselines3.sac.policies", _LATENT, "ReLU", "tanh"),
    "td3": Actor("stable_baselines3.td3.policies", ("actor.mu.",), "ReLU", "tanh"),
    "tqc": Actor("sb3_contrib.tqc.policies", _LATENT, "ReLU", "tanh"),
}
"""Networks by algorithm."""

ONLY = f"only an MlpPolicy of {', '.join(ACTORS)} can be exported"

TARGETS = ("policy", "onnx", "c")
"""What a zip is exported to."""

LOOP = ("control_rate_hz", "action_delay_s", "observation_delay_s")

CONVERT = (
    "import pickle, numpy; v = pickle.load(open('vecnormalize.pkl', 'rb')); "
    "numpy.savez('vecnormalize.npz', mean=v.obs_rms.mean, variance=v.obs_rms.var, "
    "epsilon=v.epsilon, clip=v.clip_obs)"
)
"""Program that writes the statistics of a VecNormalize as arrays."""


def weights_from_state(
    algorithm: str, state: Mapping[str, Any], activation: str, scaling: Scaling | None = None
) -> Weights:
    """The network that computes a policy's deterministic actions.

    Args:
        algorithm: of `ACTORS`.
        state: the policy's `state_dict`.
        activation: name of PyTorch's class.
        scaling: of the observation, if it was trained in a VecNormalize.
    Raises:
        ExportError: a policy that no policy file holds; says why.
    """
    actor = ACTORS[algorithm]
    if activation not in ("Tanh", "ReLU"):
        raise ExportError(f"activation_fn must be Tanh or ReLU, the model has {activation}")
    if strange := [name for name in state if "extractor." in name and "mlp_" not in name]:
        raise ExportError(f"{ONLY}; this one's observations go through {strange[0]}")
    arrays = [
        # Copies: training on must not change what was exported.
        np.array(tensor.detach().cpu().numpy(), np.float32)
        for name, tensor in state.items()
        if name.startswith(actor.tensors)
    ]
    if not arrays or not all(np.isfinite(array).all() for array in arrays):
        raise ExportError(
            f"the model must have finite weights of {' and '.join(actor.tensors)}, it has "
            f"{len(arrays)} tensors of them; where they are NaN, the training diverged: export an "
            "earlier checkpoint"
        )
    layers = tuple(map(Layer, arrays[::2], arrays[1::2]))
    return Weights(layers, activation.lower(), actor.output, scaling)


def export_controller(
    source: Path,
    target: str,
    environment: str | None,
    kwargs: Mapping[str, Any],
    out: Path,
    statistics: Path | None = None,
) -> list[Path]:
    """Write a controller as a policy file, as ONNX or as C.

    Args:
        source: zip that Stable-Baselines3 saved, a policy's file, or `pid`.
        target: "policy", "onnx" or "c"; of a zip the policy is written in any case.
        environment: id of the environment that a zip was trained on, or that a PID is for.
        kwargs: keyword arguments of that environment.
        out: NAME of what is written, its folder before it.
        statistics: file of the statistics, if a zip was trained in a VecNormalize.
    Returns:
        The files written.
    Raises:
        ExportError: a controller that cannot be exported; says why and what to do.
        OutputError: a file that cannot be written; nothing is.
        PolicyError: a policy that cannot be read or would not load.
    """
    words, weights = policy_pair(out)
    is_pid, is_policy = str(source) == "pid", source.suffix in LARGEST_MIB
    known = ("c",) if is_pid else ("onnx", "c") if is_policy else TARGETS
    if target not in known:
        raise ExportError(f"{source} can be exported --to {' or '.join(known)}, got {target}")
    code = [words.with_name(f"{identifier(words.stem)}.{end}") for end in ("h", "c")]
    extra = {"policy": [], "onnx": [words.with_suffix(".onnx")], "c": code}[target]
    written = [*(() if is_pid or is_policy else (words, weights)), *extra]
    for path in written:
        check_output(path)
    contents: list[bytes] = []
    if is_pid:
        if "pressure_kpa" not in kwargs:
            raise ExportError(
                "the gains of a PID are of a pressure, which no trial says here; give it, such as "
                "--env-kwargs '{\"pressure_kpa\": 300}'"
            )
        env = _environment(environment, kwargs)
        env.reset(seed=0)
        contents = pid_source(words.stem, env.station)
    else:
        trained = (source, environment, kwargs, statistics, words.stem)
        policy = load_policy_file(source) if is_policy else _policy(*trained)
        if target == "c":
            contents = policy_source(words.stem, policy)
        elif target == "onnx":
            contents = [onnx_bytes(policy)]
        if not is_policy:
            save_policy_file(policy, out)
    replace_files(dict(zip(extra, contents, strict=True)))
    return written


def parsed_kwargs(text: str) -> dict[str, Any]:
    """Keyword arguments of an environment from JSON.

    Raises:
        ExportError: no JSON object.
    """
    try:
        kwargs = parse_json(text.encode("utf-8", "surrogateescape"), "--env-kwargs")
    except ValueError as error:
        kwargs = error
    if not isinstance(kwargs, dict):
        why = f" ({kwargs})" if isinstance(kwargs, ValueError) else ""
        raise ExportError(
            f"--env-kwargs must be a JSON object such as '{{\"preview\": 4}}', got {text!r}{why}"
        )
    return kwargs


def _policy(
    model: Path,
    environment: str | None,
    kwargs: Mapping[str, Any],
    statistics: Path | None,
    name: str,
) -> PolicyFile:
    env = _environment(environment, kwargs)
    data, state = _read(model)
    algorithm = _algorithm(model, data)
    _check_spaces(model, data, env, f"{environment} with {json.dumps(dict(kwargs))}")
    # As text: in the JSON a class is named, and the class itself is pickled beside it.
    network = {key: str(value) for key, value in dict(data["policy_kwargs"]).items()}
    if data.get("use_sde") or "features_extractor_class" in network:
        raise ExportError(f"{ONLY}; this one has use_sde or a features_extractor_class")
    named = re.fullmatch(r"<class '[\w.]+\.(\w+)'>", network.get("activation_fn", ""))
    activation = named[1] if named else ACTORS[algorithm].activation
    scaling = _scaling(statistics, env) if statistics else None
    options, station = env.options, env.station
    view = ObservationSpec("environment", options.preview, options.history)
    used = {key: getattr(options, key) for key in LOOP} | {"model": str(options.model)}
    return PolicyFile(
        name,
        f"{algorithm.upper()} ({name})",
        weights_from_state(algorithm, state, activation, scaling),
        task_kind(station),
        {"id": environment, "kwargs": {**kwargs, **used}},
        view,
        tuple(view.rows(station, None)),
        ActionMapping("direct", MIDDLE_V),
        {
            "algorithm": algorithm,
            "preset": None,
            "seed": data.get("seed"),
            "steps": int(data["num_timesteps"]),
            "wall_s": None,
            "code": None,
            "curve": [],
            "scores": {},
        },
    )


def _environment(name: str | None, kwargs: Mapping[str, Any]) -> PMAEnv:
    if name is None or name not in ENVIRONMENTS:
        raise ExportError(f"--env must be one of {', '.join(ENVIRONMENTS)}, got {name!r}")
    try:
        env: Any = gym.make(name, **kwargs).unwrapped
    except (TypeError, ValueError) as error:
        raise ExportError(f"--env-kwargs: {error}") from None
    return env


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """A zip's JSON and its policy's tensors."""
    import torch

    try:
        with zipfile.ZipFile(path) as archive:
            data: Any = parse_json(_member(path, archive, "data"), f"{path}, data", finite=False)
            _member(path, archive, "policy.pth")
            with archive.open("policy.pth") as file:
                state = torch.load(file, map_location="cpu", weights_only=True)
        # What is used of them: anything else is no such zip.
        return {"policy_class": {}, "policy_kwargs": {}, **data}, dict(state)
    # Damaged, encrypted, packed in a way that Python lacks, or no tensors: it may raise anything.
    except Exception as error:
        raise ExportError(
            f"{path} must be a zip that Stable-Baselines3 saved (model.save), it cannot be read "
            f"as one ({error}); save the model anew"
        ) from None


def _member(path: Path, archive: zipfile.ZipFile, name: str) -> bytes:
    """A file of a zip, no more of it than the limit on documents, whatever the zip announces."""
    check_limit(f"{name} in {path}", "journal_mib", archive.getinfo(name).file_size / 2**20)
    with archive.open(name) as file:
        content = file.read((limit("journal_mib") << 20) + 1)
    check_limit(f"{name} in {path}", "journal_mib", len(content) / 2**20)
    return content


def _algorithm(path: Path, data: Mapping[str, Any]) -> str:
    module = data["policy_class"].get("__module__")
    for name, actor in ACTORS.items():
        # A2C shares PPO's policies; only PPO has a clip_range.
        if module == actor.module and (name != "ppo" or "clip_range" in data):
            return name
    raise ExportError(f"{ONLY}; the policy of {path} is of {module}")


def _check_spaces(path: Path, data: Mapping[str, Any], env: PMAEnv, words: str) -> None:
    for key in ("observation_space", "action_space"):
        space: Any = getattr(env, key)
        saved = {end: data.get(key, {}).get(end) for end in ("low", "high")}
        ours = {end: str(getattr(space, end)) for end in saved}
        if saved != ours:
            raise ExportError(
                f"{path} was trained with the {key} {saved}, {words} has {ours}; give the keyword "
                "arguments that it was trained with by --env-kwargs, and train without wrappers "
                "that change them"
            )


def _scaling(path: Path, env: PMAEnv) -> Scaling:
    """Statistics of a VecNormalize from a file of arrays."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            mean, variance = (np.asarray(arrays[key], float) for key in ("mean", "variance"))
            epsilon, clip = float(arrays["epsilon"]), float(arrays["clip"])
        if not mean.shape == variance.shape == env.observation_space.shape:
            raise ValueError(f"they are of {mean.size} entries, the observation has others")
    except Exception as error:
        raise ExportError(
            f"{path} must be an .npz of a VecNormalize's statistics for this environment, it "
            f"cannot be read as one ({error}). What it saved itself is a pickle, which may run "
            f'code: where it is your own, write the .npz by  python -c "{CONVERT}"'
        ) from None
    return Scaling(mean, variance, epsilon, clip)
