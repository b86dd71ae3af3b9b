"""Functions, loops and memory access in LLVM, for code around `SimdEmitter.emit`.

Memory layout of NumPy's array object, for compiled code.

The offsets of its first members are the same since NumPy 1.0, and every compiled extension uses
them. `are_known` checks them on test arrays; if they differ, compiled code does not use them.
"""

import ctypes
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir

# llvmlite has no type stubs, and what a checker infers from its code is wrong.
Builder = Any
"""An `ir.IRBuilder`, which writes instructions one behind the other."""

Operand = Any
"""An `ir.Value`: a result of an instruction, an argument or a constant."""

Module = ir.Module
"""Functions that are compiled together."""

POINTER = ir.PointerType()
INTEGER = ir.IntType(64)
INDEX = ir.IntType(32)
TRUTH = ir.IntType(1)
DOUBLE = ir.DoubleType()
FLOAT = ir.FloatType()

# Without the latter two LLVM keeps to half of each register of a processor with AVX-512.
_ATTRIBUTES = ("nounwind", '"prefer-vector-width"="512"', '"min-legal-vector-width"="512"')


def function(
    module: ir.Module,
    name: str,
    arguments: Sequence[tuple[str, ir.Type]],
    returns: ir.Type | None = None,
) -> tuple[Builder, list[Operand]]:
    """Begin a function.

    Args:
        module: where to add it.
        name: its name in the compiled library.
        arguments: names and types, such as ("state", POINTER). What one pointer leads to must not
            overlap with what another does.
        returns: type of the result; none if not given. End it with `builder.ret_void()` or
            `builder.ret(value)`.
    Returns:
        A builder in its first block, and its arguments.
    """
    kind = ir.FunctionType(returns or ir.VoidType(), [type_ for _, type_ in arguments])
    made = ir.Function(module, kind, name)
    for attribute in _ATTRIBUTES:
        # llvmlite's own `add` knows no attributes with a value.
        set.add(made.attributes, attribute)
    for argument, (own, type_) in zip(made.args, arguments, strict=True):
        argument.name = own
        if isinstance(type_, ir.PointerType):
            argument.add_attribute("noalias")
    return ir.IRBuilder(made.append_basic_block("entry")), list(made.args)


def integer(number: Operand | int) -> Operand:
    """A 64-bit integer constant; what is one already stays."""
    return ir.Constant(INTEGER, number) if isinstance(number, int) else number


def real(number: float) -> Operand:
    """A constant of double precision."""
    return ir.Constant(DOUBLE, number)


def offset(
    builder: Builder, pointer: Operand, index: Operand | int, element: ir.Type = DOUBLE
) -> Operand:
    """Address of the element that lies `index` elements behind a pointer."""
    return builder.gep(pointer, [integer(index)], source_etype=element)


def atomic(builder: Builder, pointer: Operand, index: Operand | int = 0) -> Operand:
    """Address of an integer that several threads read and write, for atomic operations.

    llvmlite writes these through pointers that know what they lead to only.
    """
    where = offset(builder, pointer, index, INTEGER)
    where.type = ir.PointerType(INTEGER)
    return where


def variable(
    builder: Builder, type_: ir.Type, first: Operand | None = None, name: str = ""
) -> Operand:
    """A variable of the function, to be read and written by `builder.load` and `store`.

    Args:
        builder: where its first value is written; its memory is set aside at the function's entry.
        type_: what it holds; give it to `builder.load(..., typ=type_)` too.
        first: its first value.
        name: its name in the text.
    """
    with builder.goto_entry_block():
        memory = builder.alloca(type_, name=name)
    if first is not None:
        builder.store(first, memory)
    return memory


@contextmanager
def loop(
    builder: Builder,
    stop: Operand | int,
    start: Operand | int = 0,
    step: Operand | int = 1,
) -> Iterator[Operand]:
    """Write a loop over `range(start, stop, step)`, signed; yields its index."""
    before = builder.block
    head, body, after = (builder.append_basic_block(n) for n in ("head", "body", "after"))
    builder.branch(head)
    builder.position_at_end(head)
    index = builder.phi(INTEGER, "i")
    index.add_incoming(integer(start), before)
    builder.cbranch(builder.icmp_signed("<", index, integer(stop)), body, after)
    builder.position_at_end(body)
    yield index
    index.add_incoming(builder.add(index, integer(step)), builder.block)
    builder.branch(head)
    builder.position_at_end(after)


@contextmanager
def repeat(builder: Builder) -> Iterator[Callable[[Operand], None]]:
    """Write an endless loop; yields a function that writes an exit on a condition.

    >>> builder, _ = function(ir.Module(), "f", [])
    >>> count = variable(builder, INTEGER, integer(0))
    >>> with repeat(builder) as leave_if:
    ...     now = builder.load(count, typ=INTEGER)
    ...     leave_if(builder.icmp_signed(">=", now, integer(10)))
    ...     _ = builder.store(builder.add(now, integer(1)), count)
    """
    body, after = builder.append_basic_block("again"), builder.append_basic_block("after")
    builder.branch(body)
    builder.position_at_end(body)

    def leave_if(condition: Operand) -> None:
        on = builder.append_basic_block("on")
        builder.cbranch(condition, after, on)
        builder.position_at_end(on)

    yield leave_if
    builder.branch(body)
    builder.position_at_end(after)


@contextmanager
def wait(builder: Builder) -> Iterator[Callable[[Operand], None]]:
    """Write a loop as `repeat` that waits for other threads.

    After about ten microseconds it yields the processor, which the other thread may need.
    """
    looks = variable(builder, INTEGER, integer(0))
    with repeat(builder) as leave_if:
        yield leave_if
        count = builder.add(builder.load(looks, typ=INTEGER), integer(1))
        builder.store(count, looks)
        if sys.platform != "win32":
            with builder.if_then(builder.icmp_signed(">", count, integer(LOOKS)), likely=False):
                builder.call(_external(builder.module, "sched_yield", INDEX), [])


LOOKS = 10_000
"""Number of checks before a waiting thread yields the processor."""


def _external(module: ir.Module, name: str, returns: ir.Type) -> Operand:
    """A function of the process without arguments."""
    symbol = module.globals.get(name)
    return symbol or ir.Function(module, ir.FunctionType(returns, []), name)


def intrinsic(builder: Builder, name: str, *arguments: Operand) -> Operand:
    """Call an intrinsic whose result and arguments are of one type, such as "sqrt" or "fma"."""
    type_ = arguments[0].type
    element = type_.element if isinstance(type_, ir.VectorType) else type_
    wide = f"v{type_.count}" if isinstance(type_, ir.VectorType) else ""
    full = f"llvm.{name}.{wide}{element.intrinsic_name}"
    called = builder.module.globals.get(full)
    if called is None:
        kind = ir.FunctionType(type_, [type_] * len(arguments))
        called = ir.Function(builder.module, kind, full)
    return builder.call(called, arguments)


DIMENSIONS, SIZES, STRIDES, DATA, DTYPE, TYPE = 24, 32, 40, 16, 56, 8
"""Byte offsets in an array object of its number of dimensions, sizes, strides, data address, dtype
and type, in 64-bit CPython."""

_END = 64


@cache
def are_known() -> bool:
    """Whether arrays have this layout."""
    # No member is looked at beyond an object's end.
    if np.ndarray.__basicsize__ < _END or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    return all(map(_is_known, (np.zeros(3), np.zeros((4, 2), np.float32)[::2])))


def _is_known(array: np.ndarray) -> bool:
    begin = id(array)

    def pointer(place: int) -> int | None:
        return ctypes.c_void_p.from_address(begin + place).value

    if (pointer(TYPE), pointer(DTYPE)) != (id(type(array)), id(array.dtype)):
        return False
    if pointer(DATA) != array.ctypes.data:
        return False
    if ctypes.c_int.from_address(begin + DIMENSIONS).value != array.ndim:
        return False
    pointers = [pointer(SIZES), pointer(STRIDES)]
    return None not in pointers and all(
        tuple((ctypes.c_int64 * array.ndim).from_address(at or 0)) == known
        for at, known in zip(pointers, (array.shape, array.strides), strict=True)
    )
