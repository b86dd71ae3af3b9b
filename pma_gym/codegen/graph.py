"""Arithmetic as a graph: what a law computes when it is called on values instead of numbers.

A `Value` stands for one number of a calculation that is yet to run. Arithmetic on values makes more
values; equal arithmetic makes the same value, so that nothing is computed twice. What is computed
is what was written, rounding by rounding, with the exceptions that `folding` lists.
"""

import struct
from typing import Any, Literal

from pma_gym.codegen.folding import simplify

Kind = Literal["real", "integer", "truth"]
Number = float | int | bool

FIXED, HELD, CHANGING = 0, 1, 2
"""Levels of an input: for a model's life, during a control step, new in every internal step."""

CONSTANT = -1
"""Level of a constant."""

_MASK = (1 << 64) - 1
_COMPARISONS = ("less", "less_equal", "equal", "not_equal")


class Value:
    """One node of a graph, with the operators of a number.

    Values are made by a `Graph` and by arithmetic on other values. Reals have + - * / `abs`,
    `** 0.5`, `** 2` and comparisons; integers, which are unsigned and wrap at 64 bits, + - * & | ^
    << >> and comparisons; truths & | ~. A float or int on either side is taken as a constant.

    Attributes:
        graph: the graph that it belongs to.
        id: its place in the graph, after its operands.
        operation: what makes it, such as "add"; "input" and "constant" are made of nothing.
        operands: the values that it is made of.
        data: the number of a constant, the name of an input, else None.
        kind: its kind of number.
        level: how often it changes, the greatest level of its operands.
    """

    __slots__ = ("data", "graph", "id", "kind", "level", "operands", "operation")
    # NumPy leaves the arithmetic to the value instead of spreading it over an array.
    __array_ufunc__ = None

    def __init__(
        self,
        graph: "Graph",
        operation: str,
        operands: tuple["Value", ...],
        kind: Kind,
        level: int,
        data: Any = None,  # noqa: ANN401
    ) -> None:
        self.graph = graph
        self.id = len(graph.values)
        self.operation = operation
        self.operands = operands
        self.kind: Kind = kind
        self.level = level
        self.data = data

    @property
    def is_constant(self) -> bool:
        """Whether it is a number already."""
        return self.operation == "constant"

    def __repr__(self) -> str:
        what = self.data if self.data is not None else f"{self.operation} of {len(self.operands)}"
        return f"<{self.kind} {self.id}: {what}>"

    def __bool__(self) -> bool:
        raise TypeError("a traced value has no truth yet: use where(condition, yes, no), not if")

    __hash__ = object.__hash__

    def _with(self, operation: str, other: Any, swapped: bool = False) -> Any:  # noqa: ANN401
        if not isinstance(other, Value | int | float):
            return NotImplemented
        other = self.graph.value(other, self.kind)
        pair = (other, self) if swapped else (self, other)
        return self.graph.apply(operation, *pair)

    def __add__(self, other: "Value | Number") -> "Value":
        return self._with("add", other)

    def __sub__(self, other: "Value | Number") -> "Value":
        return self._with("subtract", other)

    def __mul__(self, other: "Value | Number") -> "Value":
        return self._with("multiply", other)

    def __truediv__(self, other: "Value | Number") -> "Value":
        return self._with("divide", other)

    def __and__(self, other: "Value | Number") -> "Value":
        return self._with("and", other)

    def __or__(self, other: "Value | Number") -> "Value":
        return self._with("or", other)

    def __xor__(self, other: "Value | Number") -> "Value":
        return self._with("xor", other)

    __radd__, __rmul__ = __add__, __mul__
    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def __rsub__(self, other: Number) -> "Value":
        return self._with("subtract", other, swapped=True)

    def __rtruediv__(self, other: Number) -> "Value":
        return self._with("divide", other, swapped=True)

    def __lshift__(self, count: int) -> "Value":
        return self._with("shift_left", count)

    def __rshift__(self, count: int) -> "Value":
        return self._with("shift_right", count)

    def __lt__(self, other: "Value | Number") -> "Value":
        return self._with("less", other)

    def __le__(self, other: "Value | Number") -> "Value":
        return self._with("less_equal", other)

    def __gt__(self, other: "Value | Number") -> "Value":
        return self._with("less", other, swapped=True)

    def __ge__(self, other: "Value | Number") -> "Value":
        return self._with("less_equal", other, swapped=True)

    def __eq__(self, other: "Value | Number") -> "Value":  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._with("equal", other)

    def __ne__(self, other: "Value | Number") -> "Value":  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._with("not_equal", other)

    def __neg__(self) -> "Value":
        return self.graph.apply("negative", self)

    def __abs__(self) -> "Value":
        return self.graph.apply("absolute", self)

    def __invert__(self) -> "Value":
        return self.graph.apply("not", self)

    def __pow__(self, exponent: float) -> "Value":
        if exponent == 0.5:
            return self.graph.apply("square_root", self)
        if exponent == 2:
            return self * self
        raise TypeError(f"a traced value has the powers 0.5 and 2 only, got {exponent!r}")


_KINDS: dict[Kind, dict[str, Kind]] = {
    "real": {
        **dict.fromkeys(("add", "subtract", "multiply", "divide", "negative"), "real"),
        **dict.fromkeys(("absolute", "square_root", "floor"), "real"),
        **dict.fromkeys(_COMPARISONS, "truth"),
        "bits": "integer",
    },
    "integer": {
        **dict.fromkeys(("add", "subtract", "multiply", "and", "or", "xor"), "integer"),
        **dict.fromkeys(("shift_left", "shift_right"), "integer"),
        **dict.fromkeys(_COMPARISONS, "truth"),
        "to_real": "real",
        "from_bits": "real",
    },
    "truth": dict.fromkeys(("and", "or", "xor", "not"), "truth"),
}
"""Kind of the result by kind of the operands and operation."""


class Graph:
    """All values of one calculation; see the package for an example.

    Attributes:
        values: the values, in order of `Value.id`.
        slopes: what a value's derivative is known to be: the value that it is by, and the
            derivative, by the value's id.
    """

    def __init__(self) -> None:
        self.values: list[Value] = []
        self.slopes: dict[int, tuple[Value, Value]] = {}
        self._known: dict[tuple, Value] = {}

    def input(self, name: str, level: int, kind: Kind = "real") -> Value:
        """A value that is given when the calculation runs.

        Args:
            name: its name; the same name and kind is the same input.
            level: how often it changes: FIXED, HELD or CHANGING.
            kind: "real", "integer" or "truth".
        Raises:
            ValueError: the name is taken by an input of another kind or level.
        """
        found = self._known.get(("input", name))
        if found is None:
            found = self._known["input", name] = self._new("input", (), kind, level, name)
        elif (found.kind, found.level) != (kind, level):
            raise ValueError(f"input {name} is {found.kind} of level {found.level} already")
        return found

    def inputs(self, name: str, like: Any, level: int = FIXED) -> Any:  # noqa: ANN401
        """The same named tuple with an input for each number.

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
        """A number, as a value; an integer keeps its lowest 64 bits."""
        if kind == "real":
            number = float(number)
            key = struct.pack("<d", number)
        elif kind == "integer":
            if isinstance(number, float):
                raise TypeError(f"an integer is not made of {number!r}")
            key = number = int(number) & _MASK
        else:
            key = number = bool(number)
        found = self._known.get(("constant", kind, key))
        if found is None:
            found = self._new("constant", (), kind, CONSTANT, number)
            self._known["constant", kind, key] = found
        return found

    def value(self, given: "Value | Number", kind: Kind = "real") -> Value:
        """The value itself, or the number as a constant of this kind.

        Raises:
            ValueError: a value of another graph.
        """
        if not isinstance(given, Value):
            return self.constant(given, kind)
        if given.graph is not self:
            raise ValueError("values of two graphs in one expression")
        return given

    def apply(self, operation: str, *operands: Value) -> Value:
        """The value of an operation, simplified; the operators of `Value` come here.

        Raises:
            TypeError: operands of a kind that the operation does not take.
        """
        kind = self.kind_of(operation, operands)
        simple = simplify(self, operation, operands)
        return self.node(operation, operands, kind) if simple is None else simple

    def node(self, operation: str, operands: tuple[Value, ...], kind: Kind) -> Value:
        """The value of exactly this operation, as `simplify` wants it left."""
        key = (operation, *[operand.id for operand in operands])
        found = self._known.get(key)
        if found is None:
            level = max(operand.level for operand in operands)
            found = self._known[key] = self._new(operation, operands, kind, level)
        return found

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


def _check_shift(operation: str, operands: tuple[Value, ...]) -> None:
    if operation.startswith("shift") and not (operands[1].is_constant and operands[1].data < 64):
        raise TypeError("a traced integer is shifted by a plain number of 0 to 63 bits only")
