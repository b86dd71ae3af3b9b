"""A value of a graph: one number of a calculation that is yet to run, with a number's operators."""

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

    def __array_ufunc__(self, function: Any, method: str, *given: Any, **options: Any) -> Any:  # noqa: ANN401
        return self.__array_function__(function, (), given, options | dict(method=method))

    def __array_function__(self, function: Any, _types: Any, given: Any, options: Any) -> Any:  # noqa: ANN401
        name = function.__name__
        if options.pop("method", "__call__") != "__call__" or options or name not in NUMPY:
            raise TypeError(f"laws have no np.{name} like this; of np they have {', '.join(NUMPY)}")
        if any(isinstance(each, np.ndarray) for each in given):
            return NotImplemented
        return NUMPY[name](*(one.item() if isinstance(one, np.generic) else one for one in given))


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
    def value(self, given: Value | Number, kind: Kind = "real") -> Value:
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
