"""The words of a policy file: which keys its JSON has, and what each of them must be."""

import math
import reprlib
from collections.abc import Mapping
from typing import Any

from controllers.design.designs import EXERCISE_KINDS, KINDS
from controllers.policies.adapter import ActionMapping
from controllers.policies.network import ACTIVATIONS, OUTPUTS
from controllers.policies.observation_spec import ObservationSpec
from pma_gym.documents import parse_json

SCHEMA = 1

KEYS = {
    "": (
        "schema",
        "name",
        "title",
        "network",
        "tensors",
        "sha256",
        "task",
        "environment",
        "view",
        "observation",
        "form",
        "training",
    ),
    "network": ("layers", "activation", "output", "scaling"),
    "environment": ("id", "kwargs"),
    "training": (
        "algorithm",
        "preset",
        "seed",
        "steps",
        "wall_s",
        "code",
        "curve",
        "scores",
    ),
}
"""Keys by section: each must be there, and no other."""

LOOP = ("control_rate_hz", "action_delay_s", "observation_delay_s", "model")
"""Keys that the environment's kwargs must have; others are the environment's own options."""

LARGEST_LAYER = 65536
"""Most values of a layer."""


class PolicyError(ValueError):
    """A policy file that cannot be used; the message says which, why and the fix."""


def parsed_document(text: bytes) -> dict[str, Any]:
    """The JSON of a policy file, every key checked.

    Args:
        text: the file's content.
    Raises:
        PolicyError: no JSON, another schema, a key that is missing, unknown or has a wrong value.
    """
    try:
        document = parse_json(text, "the file")
    except ValueError as error:
        raise PolicyError(f"it is no JSON that can be used ({error})") from None
    _check(isinstance(document, dict), "it", "a JSON object", document)
    schema = document.get("schema")
    if schema != SCHEMA or isinstance(schema, bool):
        raise PolicyError(f"schema must be {SCHEMA}, the one that is known here, got {schema!r}")
    for section in KEYS:
        _check_keys(document, section)
    for key in ("name", "title"):
        _check(_is_text(document[key]), key, "a text", document[key])
    kinds = (*KINDS.values(), *EXERCISE_KINDS)
    _check(document["task"] in kinds, "task", f"one of {', '.join(kinds)}", document["task"])
    _check_network(document["network"])
    _check_tensors(document)
    _check_environment(document["environment"])
    _check_view_and_form(document)
    _check_observation(document)
    _check_training(document["training"])
    return document


def _check_keys(document: Mapping[str, Any], section: str) -> None:
    table = document[section] if section else document
    _check(isinstance(table, dict), section, "an object", table)
    what = section or "it"
    missing = [key for key in KEYS[section] if key not in table]
    if missing:
        raise PolicyError(f"{what} lacks {', '.join(missing)}")
    strange = [key for key in table if key not in KEYS[section]]
    if strange:
        raise PolicyError(
            f"{what} has {', '.join(map(_short, strange))}, which no policy of schema {SCHEMA} has"
        )


def _check_network(network: Mapping[str, Any]) -> None:
    layers = network["layers"]
    sizes = isinstance(layers, list) and all(
        _is_whole(size) and 1 <= size <= LARGEST_LAYER for size in layers
    )
    rule = f"two or more whole numbers in 1-{LARGEST_LAYER}, the last 1: a policy has one action"
    _check(sizes and len(layers) > 1 and layers[-1] == 1, "network.layers", rule, layers)
    for key, known in (("activation", ACTIVATIONS), ("output", OUTPUTS)):
        _check(network[key] in known, f"network.{key}", f"one of {', '.join(known)}", network[key])
    scaling = network["scaling"]
    good = scaling is None or (
        isinstance(scaling, dict)
        and set(scaling) == {"epsilon", "clip"}
        and all(_is_real(value) and value > 0.0 for value in scaling.values())
    )
    _check(good, "network.scaling", "null, or a positive epsilon and clip", scaling)


def _check_tensors(document: Mapping[str, Any]) -> None:
    expected = tensor_shapes(document["network"]["layers"], bool(document["network"]["scaling"]))
    tensors = document["tensors"]
    _check(isinstance(tensors, dict), "tensors", "an object of shapes by name", tensors)
    wrong = sorted(
        name for name in set(expected) | set(tensors) if tensors.get(name) != expected.get(name)
    )
    for name in wrong[:1]:
        actual = _short(tensors[name]) if name in tensors else "none"
        rule = f"the shape {expected[name]}" if name in expected else "no place"
        raise PolicyError(f"tensors: {name} has {rule} in network.layers, got {actual}")
    digest = document["sha256"]
    hexadecimal = isinstance(digest, str) and len(digest) == 64 and set(digest) <= _HEXADECIMAL
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


def _check_environment(environment: dict[str, Any]) -> None:
    _check(_is_text(environment["id"]), "environment.id", "a text", environment["id"])
    kwargs = environment["kwargs"]
    _check(isinstance(kwargs, dict), "environment.kwargs", "an object", kwargs)
    missing = [key for key in LOOP if key not in kwargs]
    if missing:
        raise PolicyError(f"environment.kwargs lacks {', '.join(missing)}")
    rate = kwargs["control_rate_hz"]
    rule = "a positive number of Hz"
    _check(_is_real(rate) and rate > 0.0, "environment.kwargs.control_rate_hz", rule, rate)
    for key in ("action_delay_s", "observation_delay_s"):
        delay = kwargs[key]
        rule = "a number of seconds, 0 or more"
        _check(_is_real(delay) and delay >= 0.0, f"environment.kwargs.{key}", rule, delay)
    _check(_is_text(kwargs["model"]), "environment.kwargs.model", "a text", kwargs["model"])


def _check_view_and_form(document: Mapping[str, Any]) -> None:
    for key, kind in (("view", ObservationSpec), ("form", ActionMapping)):
        _check(isinstance(document[key], dict), key, "an object", document[key])
        try:
            kind.of(document[key])
        except (TypeError, ValueError) as error:
            raise PolicyError(f"{key}: {error}") from None


def _check_observation(document: Mapping[str, Any]) -> None:
    rows, count = document["observation"], document["network"]["layers"][0]
    good = isinstance(rows, list) and all(
        isinstance(row, list) and len(row) == 2 and all(map(_is_text, row)) for row in rows
    )
    _check(good, "observation", "a list of [entry, what 1.0 stands for]", rows)
    if len(rows) != count:
        raise PolicyError(
            f"observation must have a row for each of the {count} entries that network.layers "
            f"begins with, got {len(rows)}"
        )


def _check_training(training: Mapping[str, Any]) -> None:
    curve = training["curve"]
    rules = {
        "algorithm": (_is_text(training["algorithm"]), "a text"),
        "preset": (_is_nothing_or(_is_text, training["preset"]), "a text or null"),
        "seed": (_is_nothing_or(_is_whole, training["seed"]), "a whole number or null"),
        "steps": (_is_whole(training["steps"]) and training["steps"] >= 0, "a count of steps"),
        "wall_s": (_is_nothing_or(_is_real, training["wall_s"]), "a number of seconds or null"),
        "code": (_is_nothing_or(_is_text, training["code"]), "a text or null"),
        "curve": (
            isinstance(curve, list) and all(map(_is_point, curve)),
            "a list of [steps, seconds, error]",
        ),
        "scores": (isinstance(training["scores"], dict), "an object"),
    }
    for key, (good, rule) in rules.items():
        _check(good, f"training.{key}", rule, training[key])


def _check(good: bool, what: str, rule: str, value: object) -> None:
    if not good:
        raise PolicyError(f"{what} must be {rule}, got {_short(value)}")


_HEXADECIMAL = frozenset("0123456789abcdef")
_short = reprlib.repr


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_real(value: object) -> bool:
    # A whole number of many digits is none that a float can hold.
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) < 1e300 and math.isfinite(value)


def _is_point(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_is_real, value))


def _is_nothing_or(rule: Any, value: object) -> bool:  # noqa: ANN401 - one of those above
    return value is None or bool(rule(value))
