"""Schemas of documents: required keys and kinds of values."""

import math
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, NamedTuple, Union, get_args, get_origin, get_type_hints


class Whole(NamedTuple):
    """A whole number within limits, both included."""

    low: float = -math.inf
    high: float = math.inf


class Real(NamedTuple):
    """A finite number within limits, both included; NaN and infinity too where allowed."""

    low: float = -math.inf
    high: float = math.inf
    finite: bool = True


class ListOf(NamedTuple):
    """A list of a least length."""

    entry: Any
    least: int = 0


class Maybe(NamedTuple):
    """An optional value."""

    shape: Any


ANY = "*"
"""Key of a table's shape that stands for all keys that the shape does not name."""

_KINDS = {object: "a value", str: "a text", bool: "true or false", dict: "a table", list: "a list"}


class ShapeError(ValueError):
    """A document that violates its schema; the message names key, rule and value."""


def check_shape(value: object, shape: Any, place: str = "") -> None:  # noqa: ANN401
    """Check a document against a schema.

    Args:
        value: the document.
        shape: `str`, `bool`, `dict` or `list` for anything of this kind; `Whole`, `Real`, `ListOf`
            or `Maybe`; or a table of shapes by key. A key that ends in `?` may be missing. Keys
            that a table of shapes does not name are not looked at.
        place: of the value, for messages.
    Raises:
        ShapeError: a key is missing, or a value is of another kind or out of range.

    Example:
        >>> check_shape({"seed": "1"}, {"seed": Whole(0), "title?": str})
        Traceback (most recent call last):
        pma_gym.document_shape.ShapeError: seed must be a whole number, 0 or more, got '1'
    """
    if isinstance(shape, Maybe):
        if value is not None:
            check_shape(value, shape.shape, place)
    elif isinstance(shape, Whole | Real):
        _check_number(value, shape, place)
    elif isinstance(shape, ListOf):
        _check(isinstance(value, list | tuple), place, "a list", value)
        assert isinstance(value, list | tuple)
        rule = f"a list of {shape.least} or more"
        _check(len(value) >= shape.least, place, rule, value)
        for number, entry in enumerate(value, start=1):
            check_shape(entry, shape.entry, f"{place}, entry {number}")
    elif isinstance(shape, Mapping):
        _check(isinstance(value, Mapping), place, "a table", value)
        assert isinstance(value, Mapping)
        _check_table(value, shape, place)
    else:
        _check(isinstance(value, shape), place, _KINDS[shape], value)


def _check_table(table: Mapping[Any, Any], shape: Mapping[str, Any], place: str) -> None:
    front = f"{place}." if place else ""
    for name, kind in shape.items():
        key = name.removesuffix("?")
        if name == ANY:
            others = [k for k in table if k not in shape and f"{k}?" not in shape]
            for other in others:
                check_shape(other, str, f"a name in {place}")
                check_shape(table[other], kind, f"{front}{other}")
        elif key in table:
            check_shape(table[key], kind, f"{front}{key}")
        elif name == key:
            raise ShapeError(f"{front}{key} is missing; it must be {_rule(kind)}")


def _check_number(value: object, shape: Whole | Real, place: str) -> None:
    kinds = int if isinstance(shape, Whole) else int | float
    good = isinstance(value, kinds) and not isinstance(value, bool)
    if good and isinstance(shape, Real) and not shape.finite and isinstance(value, float):
        return
    _check(
        # A whole number beyond the doubles fits in none.
        good and abs(value) < 1e308 and shape.low <= value <= shape.high,  # type: ignore[arg-type, operator]
        place,
        _rule(shape),
        value,
    )


def _rule(shape: Any) -> str:  # noqa: ANN401
    if isinstance(shape, Maybe):
        return f"{_rule(shape.shape)} or null"
    if isinstance(shape, ListOf):
        return "a list"
    if isinstance(shape, Mapping):
        return "a table"
    if not isinstance(shape, Whole | Real):
        return _KINDS[shape]
    kind = "a whole number" if isinstance(shape, Whole) else "a finite number"
    if math.isinf(shape.low) and math.isinf(shape.high):
        return kind
    if math.isinf(shape.high):
        return f"{kind}, {shape.low:g} or more"
    return f"{kind} in {shape.low:g} to {shape.high:g}"


def _check(good: bool, place: str, rule: str, value: object) -> None:
    if not good:
        raise ShapeError(f"{place or 'it'} must be {rule}, got {reprlib.repr(value)}")


def shape_of(hint: Any, finite: bool = True) -> Any:  # noqa: ANN401 - a type hint in, a shape out
    """Derive the schema of the JSON of a dataclass or other type hint.

    Args:
        hint: a dataclass, or what annotations are made of.
        finite: whether its numbers must be finite.

    Example:
        >>> shape_of(dict[str, list[float]])
        {'*': ListOf(entry=Real(low=-inf, high=inf, finite=True), least=0)}
    """
    origin, inside = get_origin(hint) or hint, get_args(hint)
    if origin is float:
        return Real(finite=finite)
    if origin is int:
        return Whole()
    if origin in (str, bool):
        return origin
    if origin in (Union, UnionType):
        known = [one for one in inside if one is not NoneType]
        return Maybe(shape_of(known[0], finite)) if len(known) == 1 else object
    if is_dataclass(origin):
        hints = get_type_hints(origin)
        return {
            f"{each.name}{'' if _is_needed(each) else '?'}": shape_of(hints[each.name], finite)
            for each in fields(origin)
        }
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {ANY: shape_of(inside[1], finite)} if len(inside) == 2 else dict
    if isinstance(origin, type) and issubclass(origin, Sequence):
        same = len(inside) == 1 or (len(inside) == 2 and inside[1] is Ellipsis)
        return ListOf(shape_of(inside[0], finite) if same else object)
    return object


def _is_needed(each: "Field[Any]") -> bool:
    return each.default is MISSING and each.default_factory is MISSING
