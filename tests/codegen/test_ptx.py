"""PTX text: what a GPU's driver is given. That it runs as it should, only a GPU can tell."""

import re
from collections import Counter

import pytest
from llvmlite import ir

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.machine.control import INTEGER, POINTER, integer
from pma_gym.codegen.machine.ptx import kernel, ptx, thread_count, thread_index
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.codegen.random import normals, philox
from pma_gym.codegen.trace import live_inputs, operation_counts, trace
from pma_gym.effects.slide.coulomb_friction import COULOMB_FRICTION, friction_force


def text_of(outputs, simd):
    """A kernel of one thread a lane, on rows [slot, lane]."""
    inputs, module = live_inputs(outputs), ir.Module()
    arguments = [("count", INTEGER), ("given", POINTER), ("computed", POINTER)]
    builder, (count, given, into) = kernel(module, "run", arguments)
    lane = thread_index(builder)
    with builder.if_then(builder.icmp_signed("<", lane, count)):

        def at(slot):
            return builder.add(builder.mul(count, integer(slot)), lane)

        known = {v.id: simd.load(builder, given, at(i), v.kind) for i, v in enumerate(inputs)}
        operands = simd.emit(builder, outputs, known)
        for i, value in enumerate(outputs):
            simd.store(builder, operands[value.id], into, at(i), value.kind)
    builder.ret_void()
    return ptx(module)


def instructions(text):
    return Counter(re.findall(r"^\s+(?:@\S+ )?([a-z][\w.]*)\s", text, re.MULTILINE))


@pytest.fixture(scope="module")
def friction():
    graph = Graph()
    inputs = [graph.input(name, CHANGING) for name in ("velocity", "memory")]
    return [trace(friction_force, *inputs, graph.inputs("p", COULOMB_FRICTION.start))]


def test_strict_text_rounds_every_operation(friction):
    text = text_of(friction, SimdEmitter())
    assert ".visible .entry run(" in text
    assert ".target sm_90" in text
    assert all(name in text for name in ("%ctaid.x", "%ntid.x", "%tid.x"))
    written, counts = instructions(text), operation_counts(friction)
    assert written["mul.rn.f64"] + written["add.rn.f64"] + written["sub.rn.f64"] == (
        counts["multiply"] + counts["add"]
    )
    assert written["div.rn.f64"] + written["rcp.rn.f64"] == counts["divide"]
    # Without .rn the driver would be free to fuse them.
    assert not any(name.startswith("fma") or name in ("mul.f64", "add.f64") for name in written)


def test_fused_and_single_text(friction):
    fused, single = (
        instructions(text_of(friction, simd))
        for simd in (SimdEmitter(fused=True), SimdEmitter(real="float"))
    )
    assert fused["fma.rn.f64"] > 0
    assert single["div.rn.f32"] > 0 and single["fma.rn.f32"] == 0
    assert not any(name.endswith("f64") for name in single)


def test_random_numbers_call_no_library():
    graph = Graph()
    counter = tuple(graph.input(name, CHANGING, "integer") for name in "abcd")
    text = text_of(list(normals(philox(counter, (1, 2)))), SimdEmitter())
    assert "call" not in text and ".extern" not in text
    assert instructions(text)["sqrt.rn.f64"] == 2


def test_the_architecture_is_chosen_and_threads_are_counted():
    module = ir.Module()
    builder, (into,) = kernel(module, "run", [("into", POINTER)])
    builder.store(thread_count(builder), into, align=8)
    builder.ret_void()
    text = ptx(module, "sm_80")
    assert ".target sm_80" in text and "%nctaid.x" in text
