"""Peak rates of one core: additions and multiplications, divisions, roots.

Measured with the same registers and the same compiler as the environments' kernel, on numbers that
stay in registers and wait for nobody. Beside it stands how many of each an attempt at an internal
step takes, counted in the instructions that are compiled.
"""

import ctypes
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from llvmlite import ir

from benchmarks.speed.loops import Prepared
from benchmarks.speed.rows import DISPLACEMENT
from pma_gym.codegen.machine.control import (
    DOUBLE,
    INTEGER,
    POINTER,
    Builder,
    Operand,
    function,
    intrinsic,
    loop,
    offset,
)
from pma_gym.codegen.machine.native import compiled, simd_lanes
from pma_gym.codegen.machine.simd import SimdEmitter
from pma_gym.engine.cpu.step_writer import Writer
from pma_gym.integrator.integration import FUSED, memory

CHAINS = 12
"""Registers of numbers that wait for nothing but themselves: enough to hide how long each takes,
few enough for the registers that there are."""

REPEATS = 20_000
"""Rounds of a call."""

Make = Callable[[Builder, Operand, Operand, Operand], Operand]

OPERATIONS: dict[str, Make] = {
    "multiply_add": lambda b, x, p, q: intrinsic(b, "fma", x, p, q),
    "divide": lambda b, x, p, _: b.fdiv(p, x),
    "square_root": lambda b, x, p, _: b.fmul(p, intrinsic(b, "sqrt", x)),
}
"""How a number comes from the one before, by what is measured."""

_SORTS = {
    **dict.fromkeys(("fadd", "fsub", "fmul", "llvm.fma"), "multiply_add"),
    "fdiv": "divide",
    "llvm.sqrt": "square_root",
}


def core(operation: str) -> Prepared:
    """Operations of one core in all lanes of a vector; tells how many an attempt takes.

    Args:
        operation: a name in `OPERATIONS`.
    """
    own = Path(__file__).read_text(encoding="utf-8")
    library = compiled(["core", operation, own], lambda: _module(operation), "core")
    run = library.function("run", [ctypes.c_int64, ctypes.c_void_p])
    width = simd_lanes()
    numbers = np.linspace(1.0, 2.0, (CHAINS + 2) * width)
    # A contraction for the multiply-adds, so that no number leaves the usual range.
    numbers[-2 * width : -width], numbers[-width:] = 0.9, 0.1

    def chunk() -> int:
        run(REPEATS, numbers.ctypes.data)
        return REPEATS * CHAINS * width

    counts, flops = counted()
    return Prepared(chunk, lambda: {"in_attempt": counts[operation], "flops": flops})


def _module(operation: str) -> ir.Module:
    module, simd = ir.Module(), SimdEmitter(simd_lanes())
    b, (count, numbers) = function(module, "run", [("count", INTEGER), ("numbers", POINTER)])
    loaded = [simd.load(b, numbers, i) for i in range(CHAINS + 2)]
    chains = [memory(b, simd.real) for _ in range(CHAINS)]
    for number, chain in zip(loaded, chains, strict=False):
        b.store(number, chain)
    with loop(b, count):
        for chain in chains:
            now = b.load(chain, typ=simd.real)
            b.store(OPERATIONS[operation](b, now, *loaded[CHAINS:]), chain)
    for i, chain in enumerate(chains):
        simd.store(b, b.load(chain, typ=simd.real), numbers, i)
    b.ret_void()
    return module


@cache
def counted() -> tuple[Counter[str], int]:
    """Operations in an attempt at an internal step, as the displacement's kernel has them.

    Returns:
        Instructions by sort; floating-point operations, of which a multiply-add is two.
    """
    environments: Any = gym.make_vec(
        DISPLACEMENT, num_envs=simd_lanes(), vectorization_mode="vector_entry_point"
    ).unwrapped
    writer = Writer(environments.engine.kernel)
    b, (given,) = function(ir.Module(), "attempt", [("given", POINTER)])
    known = {
        value.id: b.load(offset(b, given, i), typ=DOUBLE)
        for i, value in enumerate(writer.layout.slots)
    }
    SimdEmitter(1, fused=FUSED).emit(b, [*writer.layout.outputs, *writer.extra], known)
    names = Counter(_name(instruction) for instruction in b.block.instructions)
    counts: Counter[str] = Counter()
    for name, number in names.items():
        counts[_SORTS.get(name, "other")] += number
    return counts, sum(counts[sort] for sort in OPERATIONS) + names["llvm.fma"]


def _name(instruction: Operand) -> str:
    if isinstance(instruction, ir.CallInstr):
        return instruction.callee.name.rpartition(".")[0]
    return instruction.opname
