"""Simplifications of a graph while it is built.

All of it keeps every bit of a finite result in double precision, except the sign of a zero and
one rule, the reciprocal:

- constants are computed; x * 1, x / 1, x + 0, x - 0, --x and |-x| are the plain value; a sign goes
  out of a product or quotient and into a sum or difference. 0 * x stays, for it may be NaN.
- (x + |x|) / 2, as `positive` has it, becomes a choice between x and 0, one operation for three; a
  clip between constants becomes two independent of each other's comparison.
- Reciprocal: x / p, where p changes less often than x, becomes x * (1 / p), and 1 / p is computed
  as often as p changes. So is x / c for a constant c, exactly if c is a power of two. This is where
  the graph and the text of a law differ, by a rounding.

A value of a graph: one number of a calculation that is yet to run, with a number's operators.
"""

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Literal, NoReturn

import numpy as np

Kind = Literal["real", "integer", "truth"]
Number = float | int | bool

FIXED, HELD, CHANGING = 0, 1, 2
"""Levels of an input: for a model's life, during a control step, new in every internal step."""

CONSTANT = -1
"""Level of a constant."""

MASK = (1 << 64) - 1
COMPARISONS = ("less", "less_equal", "equal", "not_equal")

NUMPY: dict[str, Callable] = {}
"""Functions for values by NumPy's names; `elementary`, which builds on values, fills it."""


class Value:
    """One node of a graph, with the operators of a number.

    Values are made by a `Graph` and by arithmetic on other values. Reals have + - * / ** `abs`,
    comparisons, and the functions of NumPy that `elementary` lists; integers, which are unsigned
    and wrap at 64 bits, + - * & | ^ << >> and comparisons; truths & | ~. A float or int on either
    side is taken as a constant.

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

    def __init__(
        self,
        graph: "ValueGraph",
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

    def __pow__(self, exponent: "Value | Number") -> "Value":
        return NUMPY["power"](self, exponent)

    def __rpow__(self, base: Number) -> "Value":
        return NUMPY["power"](base, self)

    def __float__(self) -> NoReturn:
        raise TypeError(
            "a traced value is no number yet: use NumPy's functions, such as np.tanh(x), not math's"
        )

    def __array_ufunc__(self, function: Any, method: str, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401
        return self.__array_function__(function, (), arguments, options | dict(method=method))

    def __array_function__(self, function: Any, _types: Any, arguments: Any, options: Any) -> Any:  # noqa: ANN401
        name = function.__name__
        if options.pop("method", "__call__") != "__call__" or options or name not in NUMPY:
            raise TypeError(f"laws have no np.{name} like this; of np they have {', '.join(NUMPY)}")
        if any(isinstance(each, np.ndarray) for each in arguments):
            return NotImplemented
        return NUMPY[name](
            *(one.item() if isinstance(one, np.generic) else one for one in arguments)
        )


class ValueGraph(ABC):
    """What values and their simplification ask of the graph that they belong to.

    Attributes:
        values: the values, in order of `Value.id`.
        slopes: what a value's derivative is known to be: the value that it is by, and the
            derivative, by the value's id.
    """

    values: list[Value]
    slopes: dict[int, tuple[Value, Value]]

    @abstractmethod
    def constant(self, number: Number, kind: Kind = "real") -> Value:
        """A number, as a value."""

    @abstractmethod
    def value(self, operand: Value | Number, kind: Kind = "real") -> Value:
        """The value itself, or the number as a constant of this kind."""

    @abstractmethod
    def apply(self, operation: str, *operands: Value) -> Value:
        """The value of an operation, simplified."""

    @abstractmethod
    def node(self, operation: str, operands: tuple[Value, ...], kind: Kind) -> Value:
        """The value of exactly this operation."""

    @abstractmethod
    def select(self, condition: Value | Number, yes: Value | Number, no: Value | Number) -> Value:
        """`yes` where the condition holds, else `no`."""

    @abstractmethod
    def kind_of(self, operation: str, operands: tuple[Value, ...]) -> Kind:
        """Kind of the result of an operation."""


def to_bits(number: float) -> int:
    """The 64 bits of a real number, as an unsigned integer."""
    return struct.unpack("<Q", struct.pack("<d", number))[0]


def from_bits(bits: int) -> float:
    """The real number of these 64 bits."""
    return struct.unpack("<d", struct.pack("<Q", bits))[0]


def _divide(a: float, b: float) -> float:
    if b != 0.0:
        return a / b
    if a == 0.0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


_REAL: dict[str, Callable] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": _divide,
    "negative": lambda a: -a,
    "absolute": abs,
    "square_root": lambda a: math.sqrt(a) if a >= 0.0 else math.nan,
    "floor": lambda a: float(math.floor(a)) if math.isfinite(a) else a,
    "bits": to_bits,
}
_INTEGER: dict[str, Callable] = {
    "add": lambda a, b: (a + b) & MASK,
    "subtract": lambda a, b: (a - b) & MASK,
    "multiply": lambda a, b: (a * b) & MASK,
    "shift_left": lambda a, b: (a << b) & MASK,
    "shift_right": lambda a, b: a >> b,
    "to_real": float,
    "from_bits": from_bits,
}
_ANY: dict[str, Callable] = {
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "equal": lambda a, b: a == b,
    "not_equal": lambda a, b: a != b,
    "and": lambda a, b: a & b,
    "or": lambda a, b: a | b,
    "xor": lambda a, b: a ^ b,
    "not": lambda a: not a,
    "select": lambda condition, yes, no: yes if condition else no,
}


def compute(operation: str, kind: str, numbers: list) -> Any:  # noqa: ANN401
    """The result of an operation on plain numbers of a kind, as compiled code has it."""
    table = _INTEGER if kind == "integer" else _REAL
    return (table.get(operation) or _ANY[operation])(*numbers)


def simplify(graph: ValueGraph, operation: str, operands: tuple[Value, ...]) -> Value | None:
    """Return a simpler value for an operation, or None if there is none."""
    if all(operand.is_constant for operand in operands):
        numbers = [operand.data for operand in operands]
        kind = operands[-1].kind
        result = compute(operation, kind, numbers)
        return graph.constant(result, graph.kind_of(operation, operands))
    rule = _RULES.get(operation)
    simple = rule(graph, *operands) if rule else None
    if simple is None and operation in _COMMUTES and operands[0].id > operands[1].id:
        return graph.node(operation, operands[::-1], graph.kind_of(operation, operands))
    return simple


_COMMUTES = frozenset(("add", "multiply", "and", "or", "xor", "equal", "not_equal"))


def _is(value: Value, number: float) -> bool:
    return value.is_constant and value.data == number


def _inside(value: Value) -> Value | None:
    """What a value is the negative of."""
    return value.operands[0] if value.operation == "negative" else None


def _add(graph: ValueGraph, a: Value, b: Value) -> Value | None:
    if _is(a, 0):
        return b
    if _is(b, 0):
        return a
    plus, minus = _inside(a), _inside(b)
    if minus is not None:
        return a - minus if plus is None else -(plus + minus)
    return b - plus if plus is not None else None


def _subtract(graph: ValueGraph, a: Value, b: Value) -> Value | None:
    if _is(b, 0):
        return a
    if a.kind == "integer":
        return None
    if _is(a, 0.0):
        return -b
    plus, minus = _inside(a), _inside(b)
    if minus is not None:
        return a + minus if plus is None else minus - plus
    return -(plus + b) if plus is not None else None


def _multiply(graph: ValueGraph, a: Value, b: Value) -> Value | None:
    if b.is_constant:
        a, b = b, a
    if _is(a, 1):
        return b
    if a.kind == "integer":
        return None
    if _is(a, -1.0):
        return -b
    if _is(a, 0.5) and (whole := _twice_the_positive_part(b)) is not None:
        return graph.select(whole < 0.0, 0.0, whole)
    return _signed_product(a, b)


def _signed_product(a: Value, b: Value) -> Value | None:
    if b.level < a.level:
        a, b = b, a
    plus, minus = _inside(a), _inside(b)
    if plus is not None and minus is not None:
        return plus * minus
    if minus is not None:
        # The sign goes to the factor that is computed less often, where there is one.
        return -a * minus if a.level < b.level else -(a * minus)
    return -(plus * b) if plus is not None and a.level == b.level else None


def _twice_the_positive_part(total: Value) -> Value | None:
    if total.operation != "add":
        return None
    for value, size in (total.operands, total.operands[::-1]):
        if size.operation == "absolute" and size.operands[0] is value:
            return value
    return None


def _divide_values(graph: ValueGraph, a: Value, b: Value) -> Value | None:
    if b.is_constant:
        return a * _divide(1.0, b.data)
    above, below = _inside(a), _inside(b)
    if above is not None:
        return -(above / b)
    if below is not None:
        return -(a / below)
    return a * (1.0 / b) if b.level < a.level else None


def _negative(graph: ValueGraph, a: Value) -> Value | None:
    return _inside(a)


def _absolute(graph: ValueGraph, a: Value) -> Value | None:
    if a.operation == "absolute":
        return a
    inside = _inside(a)
    return abs(inside) if inside is not None else None


def _not(graph: ValueGraph, a: Value) -> Value | None:
    return a.operands[0] if a.operation == "not" else None


def _and(graph: ValueGraph, a: Value, b: Value) -> Value | None:
    if b.is_constant:
        a, b = b, a
    full = True if a.kind == "truth" else MASK
    if _is(a, full) or a is b:
        return b
    return a if _is(a, 0) else None


def _or(graph: ValueGraph, a: Value, b: Value) -> Value | None:
    if b.is_constant:
        a, b = b, a
    full = True if a.kind == "truth" else MASK
    if _is(a, full):
        return a
    return b if _is(a, 0) or a is b else None


def _select(graph: ValueGraph, condition: Value, yes: Value, no: Value) -> Value | None:
    if condition.is_constant:
        return yes if condition.data else no
    if yes is no:
        return yes
    if condition.operation == "not":
        return graph.select(condition.operands[0], no, yes)
    return _clip(graph, condition, yes, no)


def _clip(graph: ValueGraph, condition: Value, low: Value, inner: Value) -> Value | None:
    """A clip, low if x < low else (high if high < x else x): the upper bound, then the lower."""
    if inner.operation != "select" or not low.is_constant:
        return None
    beyond, high, value = inner.operands
    clips = (
        high.is_constant
        and low.data <= high.data
        and _is_less(condition, value, low)
        and _is_less(beyond, high, value)
    )
    return graph.select(inner < low, low, inner) if clips else None


def _is_less(condition: Value, a: Value, b: Value) -> bool:
    if condition.operation != "less":
        return False
    left, right = condition.operands
    return left is a and right is b


_RULES: dict[str, Callable[..., Value | None]] = {
    "add": _add,
    "subtract": _subtract,
    "multiply": _multiply,
    "divide": _divide_values,
    "negative": _negative,
    "absolute": _absolute,
    "not": _not,
    "and": _and,
    "or": _or,
    "select": _select,
}
