"""Traced arithmetic as readable Python, as C, and its value for given numbers."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pma_gym.codegen import generic
from pma_gym.codegen.graph import Number, Value
from pma_gym.codegen.trace import order

_MASK = "0xFFFFFFFFFFFFFFFF"

_REAL = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negative": "-{}",
    "absolute": "abs({})",
    "square_root": "square_root({})",
    "floor": "floor({})",
    "bits": "to_bits({})",
    "to_real": "to_real({})",
    "from_bits": "from_bits({})",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "equal": "{} == {}",
    "not_equal": "{} != {}",
    "and": "{} & {}",
    "or": "{} | {}",
    "xor": "{} ^ {}",
    "shift_left": "{} << {}",
    "shift_right": "{} >> {}",
    "not": "True ^ {}",
    "select": "{1} if {0} else {2}",
}


def python_text(
    outputs: Sequence[Value], inputs: Sequence[Value], name: str, arrays: bool = False
) -> str:
    """The module text of a function that does the same arithmetic in the same order.

    Args:
        outputs: what it returns, as a tuple.
        inputs: its arguments, under their own names with other signs than letters and digits as _.
        name: name of the function.
        arrays: write choices as `where`, so that it runs on NumPy arrays too; else as Python's
            own conditional, for plain numbers.
    Returns:
        The text; what it computes has the bits of compiled code wherever no denominator is 0.
    """
    names = {value.id: re.sub(r"\W", "_", value.data).rstrip("_") for value in inputs}
    if len(set(names.values())) < len(inputs):
        raise ValueError(f"inputs of {name} have the same name twice")
    lines, called = [], set()
    for value in order(outputs):
        if value.is_constant:
            names[value.id] = _number(value.data)
        elif value.id not in names:
            if value.operation == "input":
                raise ValueError(f"{name} needs the input {value.data}, which is not among its own")
            names[value.id] = f"v{value.id}"
            text = _expression(value, [names[part.id] for part in value.operands], arrays)
            called.update(re.findall(r"([a-z_]+)\(", text))
            lines.append(f"    v{value.id} = {text}")
    imported = ", ".join(sorted(called - {"abs", "float"}))
    arguments = ", ".join(names[value.id] for value in inputs)
    results = "".join(f"{names[value.id]}, " for value in outputs).rstrip()
    return "\n".join(
        [
            *([f"from pma_gym.codegen.generic import {imported}", "", ""] if imported else []),
            f"def {name}({arguments}):",
            *lines,
            f"    return ({results})",
            "",
        ]
    )


def _expression(value: Value, parts: list[str], arrays: bool) -> str:
    if value.operation == "select" and arrays:
        return f"where({', '.join(parts)})"
    text = _REAL[value.operation].format(*parts)
    wraps = value.operation in ("add", "subtract", "multiply", "shift_left")
    return f"({text}) & {_MASK}" if value.kind == "integer" and wraps else text


def _number(number: Number) -> str:
    if isinstance(number, float) and (number != number or abs(number) == float("inf")):
        return f'float("{number}")'
    return f"({number!r})" if number < 0 else repr(number)


_C = {
    **_REAL,
    "absolute": "fabs({})",
    "square_root": "sqrt({})",
    "to_real": "(double){}",
    "not": "!{}",
    "select": "{} ? {} : {}",
}
_C_TYPES = {"real": "double", "integer": "uint64_t", "truth": "int"}

C_PREAMBLE = """\
static uint64_t to_bits(double real) { uint64_t bits; memcpy(&bits, &real, 8); return bits; }
static double from_bits(uint64_t bits) { double real; memcpy(&real, &bits, 8); return real; }
"""
"""Functions that statements of `c_text` call; after math.h, stdint.h and string.h."""


def c_text(results: Mapping[str, Value], inputs: Mapping[int, str]) -> str:
    """The statements of C99 that do the same arithmetic in the same order.

    Compile them without contraction (`-ffp-contract=off`), or sums are rounded otherwise.

    Args:
        results: values by what they are assigned to, at the end and in order.
        inputs: C expressions of the inputs, and of what else is known, by id.
    """
    names, lines = dict(inputs), []
    for value in order(results.values()):
        if value.is_constant:
            names[value.id] = _c_number(value.data)
        elif value.id not in names:
            names[value.id] = f"v{value.id}"
            text = _C[value.operation].format(*(names[part.id] for part in value.operands))
            lines.append(f"    const {_C_TYPES[value.kind]} v{value.id} = {text};")
    lines += [f"    {target} = {names[value.id]};" for target, value in results.items()]
    return "\n".join(lines)


def _c_number(number: Number) -> str:
    if isinstance(number, bool):
        return str(int(number))
    if isinstance(number, int):
        return f"UINT64_C({number})"
    if number != number:
        return "NAN"
    return {"inf": "INFINITY", "-inf": "(-INFINITY)"}.get(repr(number), f"({number!r})")


_NUMPY: dict[str, Callable] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "negative": np.negative,
    "absolute": np.abs,
    "square_root": np.sqrt,
    "floor": np.floor,
    "bits": generic.to_bits,
    "to_real": generic.to_real,
    "from_bits": generic.from_bits,
    "less": np.less,
    "less_equal": np.less_equal,
    "equal": np.equal,
    "not_equal": np.not_equal,
    "and": np.bitwise_and,
    "or": np.bitwise_or,
    "xor": np.bitwise_xor,
    "shift_left": np.left_shift,
    "shift_right": np.right_shift,
    "not": np.logical_not,
    "select": np.where,
}
_TYPES = {"real": np.float64, "integer": np.uint64, "truth": np.bool_}


def evaluate(outputs: Sequence[Value], inputs: Mapping[str, Any]) -> list[np.ndarray]:
    """The outputs for numbers or NumPy arrays of one shape.

    Args:
        outputs: results of the calculation.
        inputs: a number or an array for every input that they depend on, by name.
    """
    numbers: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for value in order(outputs):
            if value.operands:
                parts = [numbers[part.id] for part in value.operands]
                numbers[value.id] = np.asarray(_NUMPY[value.operation](*parts))
            else:
                number = value.data if value.is_constant else inputs[value.data]
                numbers[value.id] = np.asarray(number, _TYPES[value.kind])
    return [numbers[value.id] for value in outputs]
