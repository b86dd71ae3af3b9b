"""Policy files: the weights of a trained network and the words that say what it is for.

A policy NAME is `NAME.safetensors`, its weights, and `NAME.json`, the rest; `policy_document.KEYS`
lists what that has. Both are data: nothing in them is executed or unpickled. All of it is checked
before anything is computed. The digest tells a pair that was cut off, mixed up or changed; it does
not tell who made it.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from controllers.policies.adapter import ActionMapping
from controllers.policies.document import SCHEMA, PolicyError, parsed_document
from controllers.policies.network import Weights, check_chain
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.tensors import safetensors, tensors_of, weights_of
from pma_gym.files import as_path, replace_files

__all__ = ["PolicyError", "PolicyFile", "load_policy_file", "policy_pair", "save_policy_file"]

LARGEST_MIB = {".safetensors": 64, ".json": 4}
"""Largest file that is read, by its ending (MiB)."""


@dataclass(frozen=True, eq=False)
class PolicyFile:
    """A trained policy: its network, observations, action mapping and origin.

    Attributes:
        name: what results call it.
        title: what reports call it.
        weights: its network.
        task: kind of the task: displacement, rotation, contraction, isokinetic or moment.
        environment: `id` and `kwargs` that it was trained with; kwargs have at least
            control_rate_hz, action_delay_s, observation_delay_s and model.
        view: what it sees.
        observation: (entry, what 1.0 stands for) in order.
        form: what its action does.
        training: algorithm, preset, seed, steps, wall_s, code, curve ([steps, wall_s, error] as
            it learned) and scores.
    """

    name: str
    title: str
    weights: Weights
    task: str
    environment: Mapping[str, Any]
    view: ObservationSpec
    observation: tuple[tuple[str, str], ...]
    form: ActionMapping
    training: Mapping[str, Any]


def load_policy_file(path: Path | str) -> PolicyFile:
    """Read a policy and check all of it.

    Args:
        path: NAME, NAME.json or NAME.safetensors.
    Raises:
        PolicyError: a file that is missing, too large, changed, or not what a policy is; says
            which and what to do.
        ImportError: safetensors is not installed; says how to install it.
    """
    document, weights = policy_pair(path)
    return _parsed(_read(document, weights), _read(weights, document), document)


def save_policy_file(policy: PolicyFile, path: Path | str) -> Path:
    """Write a policy, if it would load; an older one stays until both new files are complete.

    Args:
        policy: the policy.
        path: NAME, NAME.json or NAME.safetensors, in a folder that exists.
    Returns:
        The path of the .json file.
    Raises:
        PolicyError: a policy that would not load.
        OSError: a folder or disk that cannot be written; the old pair is as it was.
    """
    document_path, weights = policy_pair(path)
    try:
        check_chain(policy.weights)
        tensors = tensors_of(policy.weights)
        blob = safetensors().save(tensors)
        text = json.dumps(_document(policy, tensors, blob), indent=1, allow_nan=False) + "\n"
    except (TypeError, ValueError) as error:
        raise PolicyError(f"{document_path} cannot be written: {error}") from None
    _parsed(text.encode(), blob, document_path)
    # Words last: should the machine stop between the two, their digest refuses the new weights.
    replace_files({weights: blob, document_path: text.encode()})
    return document_path


def policy_pair(path: Path | str) -> tuple[Path, Path]:
    """Paths of a policy's words and weights.

    >>> [path.name for path in policy_pair("displacement-62.5hz-ppo")]
    ['displacement-62.5hz-ppo.json', 'displacement-62.5hz-ppo.safetensors']
    """
    path = as_path(path, PolicyError)
    name = path.stem if path.suffix in LARGEST_MIB else path.name
    return path.with_name(f"{name}.json"), path.with_name(f"{name}.safetensors")


def _read(path: Path, other: Path) -> bytes:
    most = LARGEST_MIB[path.suffix]
    if not path.is_file():
        raise PolicyError(
            f"there is no file {path}; a policy is two files in one folder, {path.name} and "
            f"{other.name}: check the name, copy both"
        )
    with path.open("rb") as file:
        content = file.read((most << 20) + 1)
    if len(content) > most << 20:
        raise PolicyError(
            f"{path} must have at most {most} MiB, it has {path.stat().st_size / 2**20:.1f}; it "
            "is no policy of this bench"
        )
    return content


def _parsed(text: bytes, blob: bytes, path: Path) -> PolicyFile:
    """The policy of two files' contents; messages name the file of words."""
    try:
        document = parsed_document(text)
        weights = weights_of(document, blob)
    except ValueError as error:
        raise PolicyError(f"{path}: {error}; export the policy anew, or copy both files") from None
    return PolicyFile(
        name=document["name"],
        title=document["title"],
        weights=weights,
        task=document["task"],
        environment=document["environment"],
        view=ObservationSpec.of(document["view"]),
        observation=tuple((entry, unit) for entry, unit in document["observation"]),
        form=ActionMapping.of(document["form"]),
        training=document["training"],
    )


def _document(
    policy: PolicyFile, tensors: Mapping[str, NDArray[Any]], blob: bytes
) -> dict[str, Any]:
    weights, scaling = policy.weights, policy.weights.scaling
    return {
        "schema": SCHEMA,
        "name": policy.name,
        "title": policy.title,
        "task": policy.task,
        "network": {
            "layers": weights.sizes,
            "activation": weights.activation,
            "output": weights.output,
            "scaling": scaling and {"epsilon": scaling.epsilon, "clip": scaling.clip},
        },
        "view": policy.view.to_json(),
        "form": policy.form.to_json(),
        "environment": dict(policy.environment),
        "training": dict(policy.training),
        "observation": [list(row) for row in policy.observation],
        "tensors": {name: list(tensor.shape) for name, tensor in tensors.items()},
        "sha256": hashlib.sha256(blob).hexdigest(),
    }
