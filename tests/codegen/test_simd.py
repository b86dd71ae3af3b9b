"""Loops, memory and lanes, written by hand around traced arithmetic.

Sums of many terms, in the order in which these are there.
"""

from fractions import Fraction

import llvmlite.binding as llvm
import numpy as np
import pytest
from llvmlite import ir

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.machine.control import (
    INTEGER,
    function,
    loop,
    variable,
)
from pma_gym.codegen.machine.native import assembly
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.text import evaluate


def test_variables_made_in_a_loop_are_set_aside_once():
    builder, (n,) = function(ir.Module(), "run", [("n", INTEGER)])
    with loop(builder, n) as i:
        variable(builder, INTEGER, i)
    entry, *others = builder.function.blocks
    made = [instruction.opname for instruction in entry.instructions]
    assert made.count("alloca") == 1 and made[-1] == "br"
    assert all("alloca" not in str(block) for block in others)


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
