"""Loops, memory and lanes, written by hand around traced arithmetic."""

import ctypes
from fractions import Fraction

import llvmlite.binding as llvm
import numpy as np
import pytest
from llvmlite import ir

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    function,
    integer,
    loop,
    offset,
    repeat,
    variable,
)
from pma_gym.codegen.machine.native import Library, assembly
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.text import evaluate

WIDTHS = [1, 2, 8, 16]


def call(write, *arguments, returns=None):
    """Run a function whose body `write(builder, *operands)` writes, on arrays and integers."""
    module = ir.Module()
    types = [(f"a{i}", INTEGER if isinstance(a, int) else POINTER) for i, a in enumerate(arguments)]
    builder, operands = function(module, "run", types, returns)
    result = write(builder, *operands)
    builder.ret_void() if returns is None else builder.ret(result)
    c = [ctypes.c_int64 if isinstance(a, int) else ctypes.c_void_p for a in arguments]
    result = {None: None, INTEGER: ctypes.c_int64, DOUBLE: ctypes.c_double}[returns]
    run = Library(module).function("run", c, result)
    return run(*[a if isinstance(a, int) else a.ctypes.data for a in arguments])


@pytest.mark.parametrize(("start", "step"), [(0, 1), (3, 2), (50, 1)])
def test_a_loop_is_a_range(start, step):
    def write(builder, stop, into):
        with loop(builder, stop, start, step) as i, loop(builder, 2) as j:
            where = offset(builder, into, builder.add(builder.mul(i, integer(2)), j))
            kept = builder.load(where, typ=DOUBLE)
            builder.store(builder.fadd(kept, ir.Constant(DOUBLE, 1.0)), where)

    computed = np.zeros((20, 2))
    call(write, 20, computed)
    expected = np.zeros((20, 2))
    expected[start::step] = 1.0
    np.testing.assert_array_equal(computed, expected)


def test_a_repetition_ends_where_it_is_left():
    """Collatz steps from 27."""

    def write(builder, first):
        now, count = variable(builder, INTEGER, first), variable(builder, INTEGER, integer(0))
        with repeat(builder) as leave_if:
            n = builder.load(now, typ=INTEGER)
            leave_if(builder.icmp_signed("==", n, integer(1)))
            odd = builder.trunc(n, ir.IntType(1))
            up = builder.add(builder.mul(n, integer(3)), integer(1))
            builder.store(builder.select(odd, up, builder.lshr(n, integer(1))), now)
            builder.store(builder.add(builder.load(count, typ=INTEGER), integer(1)), count)
        return builder.load(count, typ=INTEGER)

    assert call(write, 27, returns=INTEGER) == 111


def test_variables_made_in_a_loop_are_set_aside_once():
    builder, (n,) = function(ir.Module(), "run", [("n", INTEGER)])
    with loop(builder, n) as i:
        variable(builder, INTEGER, i)
    entry, *others = builder.function.blocks
    made = [instruction.opname for instruction in entry.instructions]
    assert made.count("alloca") == 1 and made[-1] == "br"
    assert all("alloca" not in str(block) for block in others)


@pytest.mark.parametrize("width", WIDTHS)
def test_lanes_are_loaded_spread_and_stored(width):
    simd = SimdEmitter(width)

    def write(builder, given, into):
        simd.store(builder, simd.load(builder, given, 1), into, 0)
        simd.store(builder, simd.constant(0.1), into, 1)
        last = simd.extract(builder, simd.load(builder, given, integer(2)), width - 1)
        simd.store(builder, simd.spread(builder, last), into, 2)
        row = simd.load(builder, given, 0)
        simd.store(builder, simd.insert(builder, row, last, integer(0)), into, integer(3))

    given = np.arange(3.0 * width).reshape(3, width) + 0.5
    into = np.zeros((4, width))
    call(write, given, into)
    np.testing.assert_array_equal(into[0], given[1])
    np.testing.assert_array_equal(into[1], np.full(width, 0.1))
    np.testing.assert_array_equal(into[2], np.full(width, given[2, -1]))
    np.testing.assert_array_equal(into[3], [given[2, -1], *given[0, 1:]])


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("truths", ["none", "first", "last", "all"])
def test_any_and_all(width, truths):
    simd = SimdEmitter(width)

    def write(builder, given):
        mask = simd.load(builder, given, kind="truth")
        some, every = simd.any(builder, mask), simd.all(builder, mask)
        return builder.add(
            builder.zext(some, INTEGER), builder.mul(builder.zext(every, INTEGER), integer(2))
        )

    given = np.zeros(width)
    given[{"none": slice(0), "first": slice(1), "last": -1, "all": slice(None)}[truths]] = 1.0
    assert call(write, given, returns=INTEGER) == int(given.any()) + 2 * int(given.all())


@pytest.mark.parametrize(("width", "paired"), [(1, False), (1, True), (8, False)])
def test_every_kind_is_kept_and_every_operation_written(width, paired, run_columns):
    graph = Graph()
    x, y = (graph.input(name, CHANGING) for name in "xy")
    i, t = graph.input("i", CHANGING, "integer"), graph.input("t", CHANGING, "truth")
    outputs = [
        *(x < y, x <= y, x > y, x >= y, x == y, x != y),
        *(t & (x < y), t | (x < y), t ^ (x < y), ~t, graph.select(t, x, y)),
        *(i + 3, i - 3, i * 3, i & 6, i | 6, i ^ 6, i << 3, i >> 3, i < 4, i <= 4, i == 4),
        *(graph.apply("to_real", i), graph.apply("bits", x), graph.apply("floor", x * 3.7)),
        graph.apply("from_bits", graph.apply("bits", y) + 1),
        *(-x, abs(x), abs(x) ** 0.5, x / y),
    ]
    draw = np.random.default_rng(1)
    given = {
        "x": np.array([*draw.normal(size=14), 1.0, np.nan]),
        "y": np.array([*draw.normal(size=14), 1.0, 1.0]),
        "i": np.array([0, 4, 2**63, 2**64 - 1] * 4, np.uint64),
        "t": np.array([0.0, 1.0] * 8),
    }
    columns = run_columns(outputs, given, width, paired=paired)
    for column, expected in zip(columns, evaluate(outputs, given), strict=True):
        np.testing.assert_array_equal(column, expected)


def test_an_input_that_is_not_given_is_named():
    graph = Graph()
    builder, _ = function(ir.Module(), "run", [])
    with pytest.raises(KeyError, match="input x is not given"):
        SimdEmitter().emit(builder, [graph.input("x", CHANGING) + 1.0], {})


def test_what_is_known_is_not_computed_again():
    graph = Graph()
    x = graph.input("x", CHANGING)
    root = (x * x + 1.0) ** 0.5
    module = ir.Module()
    builder, (given,) = function(module, "run", [("given", DOUBLE)], DOUBLE)
    operands = SimdEmitter().emit(builder, [root * 2.0], {root.id: given})
    builder.ret(operands[(root * 2.0).id])
    assert "sqrt" not in str(module)


def test_strict_code_rounds_twice_and_fused_code_once(run_columns):
    graph = Graph()
    a, b, c = (graph.input(name, CHANGING) for name in "abc")
    outputs = [a * b + c, c - a * b, a * b - c]
    draw = np.random.default_rng(2)
    given = {name: draw.normal(size=64) for name in "abc"}
    given["c"] = -given["a"] * given["b"]
    x, y, z = given.values()
    for computed, expected in zip(
        run_columns(outputs, given, 8), (x * y + z, z - x * y, x * y - z), strict=True
    ):
        np.testing.assert_array_equal(computed, expected)
    signs = ((1, 1), (-1, 1), (1, -1))
    alone = [run_columns([output], given, 1, fused=True)[0] for output in outputs]
    # One product in three sums goes into all of them.
    for columns in (alone, run_columns(outputs, given, 8, fused=True)):
        for column, (sign, own) in zip(columns, signs, strict=True):
            for i in range(64):
                product = Fraction(x[i]) * Fraction(y[i])
                assert column[i] == float(sign * product + own * Fraction(z[i]))


def test_wide_registers_are_used_where_there_are_some(build_columns):
    features = llvm.get_host_cpu_features()
    if not features.get("avx512f"):
        pytest.skip("needs AVX-512")
    graph = Graph()
    x, y = (graph.input(name, CHANGING) for name in "xy")
    text = assembly(str(build_columns([x / y + abs(x) ** 0.5], [x, y], SimdEmitter(8))))
    assert "vdivpd" in text and "vsqrtpd" in text
    assert all("%zmm" in line for line in text.splitlines() if "divpd" in line)
    assert "vfmadd" not in text
