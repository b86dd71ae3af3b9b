"""Expression graphs: the arithmetic of a law that is called with symbolic values.

A `Value` is one number of a later calculation. Arithmetic on values makes more values; equal
arithmetic makes the same value, so that nothing is computed twice. The calculation has the
roundings of the law's text, with the exceptions that `folding` lists.
"""

import struct
from collections.abc import Mapping
from typing import Any

from pma_gym.codegen import elementary  # noqa: F401 - fills the functions of values
from pma_gym.codegen.folding import (
    CHANGING,
    COMPARISONS,
    CONSTANT,
    FIXED,
    HELD,
    MASK,
    Kind,
    Number,
    Value,
    ValueGraph,
    compute,
    simplify,
)

__all__ = [
    "CHANGING",
    "CONSTANT",
    "FIXED",
    "HELD",
    "Graph",
    "Kind",
    "Number",
    "NumberGraph",
    "Value",
]

_KINDS: dict[Kind, dict[str, Kind]] = {
    "real": {
        **dict.fromkeys(("add", "subtract", "multiply", "divide", "negative"), "real"),
        **dict.fromkeys(("absolute", "square_root", "floor"), "real"),
        **dict.fromkeys(COMPARISONS, "truth"),
        "bits": "integer",
    },
    "integer": {
        **dict.fromkeys(("add", "subtract", "multiply", "and", "or", "xor"), "integer"),
        **dict.fromkeys(("shift_left", "shift_right"), "integer"),
        **dict.fromkeys(COMPARISONS, "truth"),
        "to_real": "real",
        "from_bits": "real",
    },
    "truth": dict.fromkeys(("and", "or", "xor", "not"), "truth"),
}
"""Kind of the result by kind of the operands and operation."""


class Graph(ValueGraph):
    """All values of one calculation; see the package for an example.

    Attributes:
        values: the values, in order of `Value.id`.
        slopes: known derivatives, keyed by the value's id: the argument and the derivative.
    """

    def __init__(self) -> None:
        self.values: list[Value] = []
        self.slopes: dict[int, tuple[Value, Value]] = {}
        self._known: dict[tuple, Value] = {}

    def input(self, name: str, level: int, kind: Kind = "real") -> Value:
        """Make an input of the calculation.

        Args:
            name: its name; the same name and kind is the same input.
            level: how often it changes: FIXED, HELD or CHANGING.
            kind: "real", "integer" or "truth".
        Raises:
            ValueError: the name is taken by an input of another kind or level.
        """
        value = self._known.get(("input", name))
        if value is None:
            value = self._known["input", name] = self._new("input", (), kind, level, name)
        elif (value.kind, value.level) != (kind, level):
            raise ValueError(f"input {name} is {value.kind} of level {value.level} already")
        return value

    def inputs(self, name: str, like: Any, level: int = FIXED) -> Any:  # noqa: ANN401
        """Make a named tuple of inputs, one for each number of another named tuple.

        Args:
            name: what the names of the inputs begin with: name.field, and name.field[0] in rows.
            like: a NamedTuple of numbers and rows of numbers, such as an effect's parameters.
            level: level of the inputs.
        """

        def one(field: str, value: float | tuple[float, ...]) -> Value | tuple[Value, ...]:
            if isinstance(value, tuple):
                return tuple(self.input(f"{field}[{i}]", level) for i in range(len(value)))
            return self.input(field, level)

        return like._replace(**{f: one(f"{name}.{f}", v) for f, v in like._asdict().items()})

    def constant(self, number: Number, kind: Kind = "real") -> Value:
        """Make a constant from a number; an integer keeps its lowest 64 bits."""
        if kind == "real":
            number = float(number)
            key = struct.pack("<d", number)
        elif kind == "integer":
            if isinstance(number, float):
                raise TypeError(f"an integer is not made of {number!r}")
            key = number = int(number) & MASK
        else:
            key = number = bool(number)
        value = self._known.get(("constant", kind, key))
        if value is None:
            value = self._new("constant", (), kind, CONSTANT, number)
            self._known["constant", kind, key] = value
        return value

    def value(self, operand: "Value | Number", kind: Kind = "real") -> Value:
        """Return a value unchanged, or a number as a constant of this kind.

        Raises:
            ValueError: a value of another graph.
        """
        if not isinstance(operand, Value):
            return self.constant(operand, kind)
        if operand.graph is not self:
            raise ValueError("values of two graphs in one expression")
        return operand

    def apply(self, operation: str, *operands: Value) -> Value:
        """Make the simplified value of an operation; the operators of `Value` call this.

        Raises:
            TypeError: operands of a kind that the operation does not take.
        """
        kind = self.kind_of(operation, operands)
        simple = simplify(self, operation, operands)
        return self.node(operation, operands, kind) if simple is None else simple

    def node(self, operation: str, operands: tuple[Value, ...], kind: Kind) -> Value:
        """Make the value of an operation without simplification."""
        key = (operation, *[operand.id for operand in operands])
        value = self._known.get(key)
        if value is None:
            level = max(operand.level for operand in operands)
            value = self._known[key] = self._new(operation, operands, kind, level)
        return value

    def select(
        self, condition: "Value | Number", yes: "Value | Number", no: "Value | Number"
    ) -> Value:
        """`yes` where the condition holds, else `no`."""
        kinds: list[Kind] = [value.kind for value in (yes, no) if isinstance(value, Value)]
        kind = kinds[0] if kinds else "real"
        sides = self.value(yes, kind), self.value(no, kind)
        return self.apply("select", self.value(condition, "truth"), *sides)

    def _new(self, *made: Any) -> Value:
        value = Value(self, *made)
        self.values.append(value)
        return value

    def kind_of(self, operation: str, operands: tuple[Value, ...]) -> Kind:
        """Kind of the result of an operation; TypeError if there is no such operation."""
        kinds: list[Kind] = [operand.kind for operand in operands]
        if operation == "select":
            if kinds[0] == "truth" and kinds[1] == kinds[2]:
                return kinds[1]
        elif len(set(kinds)) == 1 and operation in _KINDS[kinds[0]]:
            _check_shift(operation, operands)
            return _KINDS[kinds[0]][operation]
        raise TypeError(f"no {operation} of {' and '.join(kinds)}")


class NumberGraph(Graph):
    """A graph whose inputs are numbers: what is traced in it is calculated at once.

    A law that is traced in it gets constants; `Value.data` of each is its number.

    Args:
        numbers: number of every input, by name.
    """

    def __init__(self, numbers: Mapping[str, Number]) -> None:
        super().__init__()
        self.numbers = numbers

    def input(self, name: str, level: int, kind: Kind = "real") -> Value:
        """Return an input's number as a constant; the level has no meaning here."""
        return self._new("constant", (), kind, CONSTANT, self.numbers[name])

    def apply(self, operation: str, *operands: Value) -> Value:
        """Calculate at once; equal numbers are values of their own, unlike in a `Graph`."""
        number = compute(operation, operands[-1].kind, [operand.data for operand in operands])
        return self._new("constant", (), self.kind_of(operation, operands), CONSTANT, number)


def _check_shift(operation: str, operands: tuple[Value, ...]) -> None:
    if operation.startswith("shift") and not (operands[1].is_constant and operands[1].data < 64):
        raise TypeError("a traced integer is shifted by a plain number of 0 to 63 bits only")
