"""The weights of a policy file: tensors by name, checked against the JSON beside them."""

import hashlib
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controllers.policies.document import PolicyError
from controllers.policies.network import Layer, Scaling, Weights, check_chain


def weights_of(document: Mapping[str, Any], blob: bytes) -> Weights:
    """The network of a policy.

    Args:
        document: the words, checked.
        blob: content of the file of weights.
    Raises:
        ValueError: other weights than the words', of another shape or kind, or not finite.
        ImportError: safetensors is not installed; says how to install it.
    """
    network, tensors = document["network"], _checked(document, blob)
    layers = tuple(
        Layer(tensors[f"layers.{i}.weight"], tensors[f"layers.{i}.bias"])
        for i in range(len(network["layers"]) - 1)
    )
    scaling = network["scaling"] and Scaling(
        tensors["scaling.mean"], tensors["scaling.variance"], **network["scaling"]
    )
    weights = Weights(layers, network["activation"], network["output"], scaling)
    check_chain(weights)
    return weights


def tensors_of(weights: Weights) -> dict[str, NDArray[Any]]:
    """Tensors of a network by name, as they are written."""
    tensors: dict[str, NDArray[Any]] = {}
    for i, (weight, bias) in enumerate(weights.layers):
        tensors |= {f"layers.{i}.weight": weight, f"layers.{i}.bias": bias}
    if weights.scaling:
        tensors |= {
            "scaling.mean": weights.scaling.mean,
            "scaling.variance": weights.scaling.variance,
        }
    # The package writes what lies in memory, whatever an array's order says.
    return {name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()}


def safetensors() -> ModuleType:
    """The module safetensors.numpy.

    Raises:
        ImportError: it is not installed; says how to install it.
    """
    try:
        from safetensors import numpy
    except ImportError:
        raise ImportError(
            "trained policies need safetensors, which is not installed: pip install "
            "pma-gym[policies], or in a clone: pip install -c constraints.txt -e '.[policies]'"
        ) from None
    return numpy


def _checked(document: Mapping[str, Any], blob: bytes) -> dict[str, NDArray[Any]]:
    digest = hashlib.sha256(blob).hexdigest()
    if digest != document["sha256"]:
        raise PolicyError(
            f"the weights beside it are not the ones it was written with: they have sha256 "
            f"{digest[:12]}..., it says {document['sha256'][:12]}...; one of the two files was cut "
            "off, changed or mixed up"
        )
    load = safetensors().load
    try:
        tensors = load(blob)
    # The package raises errors of its own, and those of NumPy for number formats that it lacks.
    except Exception as error:
        raise PolicyError(f"the weights beside it are no safetensors ({error!s:.160})") from None
    shapes = document["tensors"]
    if set(tensors) != set(shapes):
        raise PolicyError(
            f"the weights must be the tensors {', '.join(sorted(shapes))}; "
            f"missing: {', '.join(sorted(set(shapes) - set(tensors))) or 'none'}, "
            f"unexpected: {', '.join(sorted(set(tensors) - set(shapes))) or 'none'}"
        )
    for name, shape in shapes.items():
        _check_tensor(name, tensors[name], shape)
    return tensors


def _check_tensor(name: str, tensor: NDArray[Any], shape: list[int]) -> None:
    dtype = np.dtype(np.float64 if name.startswith("scaling.") else np.float32)
    if list(tensor.shape) != shape or tensor.dtype != dtype:
        raise PolicyError(
            f"tensor {name} must have the shape {shape} in {dtype}, it has {list(tensor.shape)} "
            f"in {tensor.dtype}"
        )
    strange = np.count_nonzero(~np.isfinite(tensor))
    if strange:
        raise PolicyError(
            f"tensor {name} must hold finite numbers, {strange} of its {tensor.size} are NaN or "
            "infinite: the training diverged"
        )
