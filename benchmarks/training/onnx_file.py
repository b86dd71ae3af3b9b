"""Policies as ONNX, for programs in other languages and for rigs that run no Python."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.files import write_bytes
from controllers.policies.network import Scaling
from controllers.policies.policy_file import PolicyFile

OPSET, IR_VERSION = 17, 8
"""Of 2022: runtimes that came out since read it."""


class ExportError(ValueError):
    """A model that cannot be exported; the message says why and the fix."""


def write_onnx(policy: PolicyFile, path: Path) -> None:
    """Write a policy's network as ONNX: `observation` (rows, entries) to `action` (rows, 1).

    It computes in float32 but for the scaling, with the view, the form and all else that the words
    of the policy say in the metadata.

    Args:
        policy: the policy.
        path: the file; its folder is made.
    Raises:
        ExportError: onnx is not installed.
    """
    write_bytes(path, onnx_bytes(policy))


def onnx_bytes(policy: PolicyFile) -> bytes:
    """Build the ONNX file of `write_onnx` in memory."""
    onnx = _imported()
    model = _model(onnx, policy)
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)


def _model(onnx: Any, policy: PolicyFile) -> Any:  # noqa: ANN401 - the optional package
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    nodes, constants, entry = _scaling(onnx, policy.weights.scaling)
    weights = policy.weights
    for i, (weight, bias) in enumerate(weights.layers):
        constants |= {f"weight_{i}": weight, f"bias_{i}": bias}
        nodes.append(
            helper.make_node("Gemm", [entry, f"weight_{i}", f"bias_{i}"], [f"sum_{i}"], transB=1)
        )
        last = i == len(weights.layers) - 1
        entry = "action" if last else f"value_{i}"
        nodes.append(_node_after(helper, weights.output if last else weights.activation, i, entry))
        if last and weights.output == "clip":
            constants |= {"lowest": np.float32(-1.0), "highest": np.float32(1.0)}
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", kind, ["rows", weights.sizes[0]])],
        [helper.make_tensor_value_info("action", kind, ["rows", weights.sizes[-1]])],
        [onnx.numpy_helper.from_array(np.asarray(c), name) for name, c in constants.items()],
    )
    opset = helper.make_opsetid("", OPSET)
    model = helper.make_model(graph, opset_imports=[opset], ir_version=IR_VERSION)
    model.producer_name, model.doc_string = "pma-gym", policy.title
    helper.set_model_props(model, _properties(policy))
    return model


def _node_after(helper: Any, what: str, i: int, out: str) -> Any:  # noqa: ANN401
    """What follows a layer's sum."""
    if what == "clip":
        return helper.make_node("Clip", [f"sum_{i}", "lowest", "highest"], [out])
    return helper.make_node({"tanh": "Tanh", "relu": "Relu"}[what], [f"sum_{i}"], [out])


def _scaling(onnx: Any, scaling: Scaling | None) -> tuple[list[Any], dict[str, Any], str]:  # noqa: ANN401
    """Nodes and constants that scale the observation, and the name of what they give."""
    if scaling is None:
        return [], {}, "observation"
    node, kinds = onnx.helper.make_node, onnx.TensorProto
    # In float64: an entry that hardly varied is divided by a deviation of 1e-4.
    nodes = [
        node("Cast", ["observation"], ["read"], to=kinds.DOUBLE),
        node("Sub", ["read", "mean"], ["centred"]),
        node("Div", ["centred", "deviation"], ["divided"]),
        node("Clip", ["divided", "least", "most"], ["held"]),
        node("Cast", ["held"], ["scaled"], to=kinds.FLOAT),
    ]
    constants = {
        "mean": scaling.mean,
        "deviation": np.sqrt(scaling.variance + scaling.epsilon),
        "least": np.float64(-scaling.clip),
        "most": np.float64(scaling.clip),
    }
    return nodes, constants, "scaled"


def _properties(policy: PolicyFile) -> dict[str, str]:
    """The words of a policy as texts, what is no text as JSON."""
    return {
        "name": policy.name,
        "title": policy.title,
        "task": policy.task,
        "view": json.dumps(policy.view.to_json()),
        "form": json.dumps(policy.form.to_json()),
        "observation": json.dumps(policy.observation),
        "environment": json.dumps(dict(policy.environment)),
        "algorithm": str(policy.training["algorithm"]),
    }


def _imported() -> Any:  # noqa: ANN401
    try:
        import onnx
    except ImportError:
        raise ExportError(
            "an ONNX file needs the package onnx, which is not installed: "
            "pip install -c constraints.txt -e '.[onnx]'"
        ) from None
    return onnx
