"""Models of randomised stations as exact documents in SI; model files round their numbers."""

import math
from collections.abc import Mapping
from typing import Any

from pma_gym.engine.snapshot import StateError
from pma_gym.plant.model import Model, known_effect
from pma_gym.plant.parameter_rows import Note
from pma_gym.units import Quantity

ROUNDING = 1e-9
"""Relative tolerance of a parameter's bounds, for the conversion to SI and back."""


def model_document(model: Model) -> dict[str, Any]:
    """Return a model as numbers and texts, with parameters in SI by effect and field."""
    return {
        "name": model.name,
        "title": model.title,
        "plant": model.plant,
        "parameters": {effect: _floats(p) for effect, p in model.parameters.items()},
        "notes": {path: [n.source, n.low, n.high] for path, n in model.notes.items()},
    }


def parse_model_document(document: Mapping[str, Any]) -> Model:
    """Make a model from a document of `model_document`.

    Raises:
        StateError: an unknown parameter, or a value out of its bounds.
        ModelError: an unknown effect, or effects that do not form a plant.
    """
    parameters = {name: _parameters(name, p) for name, p in document["parameters"].items()}
    notes = {path: _note(path, note) for path, note in document["notes"].items()}
    name, title, plant = (str(document[key]) for key in ("name", "title", "plant"))
    return Model(name, title, plant, parameters, notes)


def _floats(parameters: Any) -> dict[str, Any]:  # noqa: ANN401
    return {
        field: list(map(float, value)) if isinstance(value, tuple) else float(value)
        for field, value in parameters._asdict().items()
    }


def _note(path: str, given: Any) -> Note:  # noqa: ANN401
    source, low, high = given
    if not (
        isinstance(source, str) and all(isinstance(n, int | float | None) for n in (low, high))
    ):
        raise StateError(f"the note of {path} must be a text and two numbers, got {given!r}")
    return Note(source, low, high)


def _parameters(name: str, given: Mapping[str, Any]) -> Any:  # noqa: ANN401
    effect = known_effect(name)
    if set(given) != set(effect.quantities):
        raise StateError(
            f"[{name}] of a drawn station must have {', '.join(effect.quantities)}, got "
            f"{', '.join(map(str, given))}"
        )
    for field, quantity in effect.quantities.items():
        many = field in effect.rows
        numbers = given[field] if many else [given[field]]
        if not isinstance(numbers, list) or not all(_within(quantity, one) for one in numbers):
            raise StateError(
                f"{name}.{quantity.name(field)} of a drawn station must lie in "
                f"{quantity.lower:g}-{quantity.upper:g} {quantity.unit}, got {given[field]!r} in SI"
            )
    values = {f: tuple(v) if isinstance(v, list) else v for f, v in given.items()}
    return effect.checked(effect.parameters(**values))


def _within(quantity: Quantity, number: object) -> bool:
    if not isinstance(number, float) or not math.isfinite(number):
        return False
    lower = quantity.lower - ROUNDING * abs(quantity.lower)
    upper = quantity.upper + ROUNDING * abs(quantity.upper)
    return lower <= quantity.from_si(number) <= upper
