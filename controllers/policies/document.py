"""The document of a policy file: which keys its JSON has, and what each of them must be."""

import re
import reprlib
from collections.abc import Mapping
from typing import Any

from controllers.design.designs import EXERCISE_KINDS, KINDS
from controllers.policies.adapter import ActionMapping
from controllers.policies.network import ACTIVATIONS, OUTPUTS
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.document_shape import ListOf, Maybe, Real, ShapeError, Whole, check_shape
from pma_gym.documents import parse_json

SCHEMA = 1

LARGEST_LAYER = 65536
"""Most values of a layer."""

SHAPE: dict[str, Any] = {
    "schema": Whole(),
    "name": str,
    "title": str,
    "network": {
        "layers": ListOf(Whole(1, LARGEST_LAYER), 2),
        "activation": str,
        "output": str,
        "scaling": Maybe({"epsilon": Real(), "clip": Real()}),
    },
    "tensors": dict,
    "sha256": str,
    "task": str,
    "environment": {
        "id": str,
        "kwargs": {
            "control_rate_hz": Real(),
            "action_delay_s": Real(0.0),
            "observation_delay_s": Real(0.0),
            "model": str,
        },
    },
    "view": dict,
    "observation": ListOf(ListOf(str, 2)),
    "form": dict,
    "training": {
        "algorithm": str,
        "preset": Maybe(str),
        "seed": Maybe(Whole()),
        "steps": Whole(0),
        "wall_s": Maybe(Real()),
        "code": Maybe(str),
        "curve": ListOf(ListOf(Real(), 3)),
        "scores": dict,
    },
}
"""Schema of the document; the environment's kwargs may have further keys, its own options."""


class PolicyError(ValueError):
    """A policy file that cannot be used; the message says which, why and the fix."""


def parsed_document(text: bytes) -> dict[str, Any]:
    """The JSON of a policy file, every key checked.

    Args:
        text: content of the file.
    Raises:
        PolicyError: what is wrong.
    """
    try:
        document: Any = parse_json(text, "the file")
        check_shape(document, SHAPE)
    except ShapeError as error:
        raise PolicyError(str(error)) from None
    except ValueError as error:
        raise PolicyError(f"it is no JSON that can be used ({error})") from None
    rule = f"{SCHEMA}, the one that is known here"
    _check(document["schema"] == SCHEMA, "schema", rule, document["schema"])
    network, rate = document["network"], document["environment"]["kwargs"]["control_rate_hz"]
    scaling = network["scaling"] or {}
    sections = {"": SHAPE, **{k: SHAPE[k] for k in ("network", "environment", "training")}}
    for section, shape in sections.items():
        for key in document[section] if section else document:
            rule = "among the keys of such a file"
            _check(key in shape, f"the key {key!r} of {section or 'the file'}", rule, key)
    for key in ("name", "title"):
        _check(document[key].strip(), key, "a text", document[key])
    choices = (
        ("task", document["task"], (*KINDS.values(), *EXERCISE_KINDS)),
        ("network.activation", network["activation"], ACTIVATIONS),
        ("network.output", network["output"], OUTPUTS),
    )
    for what, value, known in choices:
        _check(value in known, what, f"one of {', '.join(known)}", value)
    last = network["layers"][-1]
    _check(last == 1, "the last of network.layers", "1: a policy has one action", last)
    positive = set(scaling) <= {"epsilon", "clip"} and all(x > 0.0 for x in scaling.values())
    _check(positive, "network.scaling", "null, or a positive epsilon and clip", scaling)
    _check(rate > 0.0, "environment.kwargs.control_rate_hz", "a positive number of Hz", rate)
    _check_tensors(document)
    _check_view_and_form(document)
    _check_rows(document["observation"], network["layers"][0], document["training"]["curve"])
    return document


def _check_tensors(document: Mapping[str, Any]) -> None:
    expected = tensor_shapes(document["network"]["layers"], bool(document["network"]["scaling"]))
    tensors = document["tensors"]
    for name in sorted(set(expected) | set(tensors)):
        rule = f"of the shape {expected[name]}" if name in expected else "without a place"
        right = tensors.get(name) == expected.get(name)
        _check(right, f"tensors: {name}", f"{rule} in network.layers", tensors.get(name))
    digest = document["sha256"]
    hexadecimal = re.fullmatch("[0-9a-f]{64}", digest)
    _check(hexadecimal, "sha256", "64 hexadecimal digits in small letters", digest)


def tensor_shapes(sizes: list[int], scaled: bool) -> dict[str, list[int]]:
    """Shape of every tensor by its name.

    >>> tensor_shapes([3, 1], False)
    {'layers.0.weight': [1, 3], 'layers.0.bias': [1]}
    """
    shapes: dict[str, list[int]] = {}
    for i, (inputs, outputs) in enumerate(zip(sizes, sizes[1:], strict=False)):
        shapes |= {f"layers.{i}.weight": [outputs, inputs], f"layers.{i}.bias": [outputs]}
    if scaled:
        shapes |= {"scaling.mean": [sizes[0]], "scaling.variance": [sizes[0]]}
    return shapes


def _check_view_and_form(document: Mapping[str, Any]) -> None:
    for key, kind in (("view", ObservationSpec), ("form", ActionMapping)):
        try:
            kind.of(document[key])
        except (TypeError, ValueError) as error:
            raise PolicyError(f"{key}: {error}") from None


def _check_rows(observation: list[Any], entries: int, curve: list[Any]) -> None:
    pairs = len(observation) == entries and all(len(row) == 2 for row in observation)
    _check(
        pairs,
        "observation",
        f"a list of {entries} [entry, what 1.0 stands for], as network.layers begins",
        observation,
    )
    points = all(len(point) == 3 for point in curve)
    _check(points, "training.curve", "a list of [steps, seconds, error]", curve)


def _check(good: object, what: str, rule: str, value: object) -> None:
    if not good:
        raise PolicyError(f"{what} must be {rule}, got {reprlib.repr(value)}")
