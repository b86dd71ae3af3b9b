"""Traced arithmetic for NVIDIA GPUs, as PTX text, which the GPU's driver compiles.

One thread does one lane: emit with `SimdEmitter(1)`. No CUDA toolkit is needed, for LLVM
writes the text. Sums and products are written as rounding each, so that a GPU too gives the bits of
a processor.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir

from pma_gym.codegen.machine.control import INDEX, INTEGER, TRUTH, Builder, Operand, function
from pma_gym.codegen.machine.native import optimise

WARP = 32
"""Threads that run together, instruction by instruction."""

_TRIPLE = "nvptx64-nvidia-cuda"
_ALL = ir.Constant(INDEX, 0xFFFFFFFF)
_SHARED = 3
"""The address space of a block's own memory."""


def kernel(
    module: ir.Module, name: str, arguments: Sequence[tuple[str, ir.Type]]
) -> tuple[Builder, list[Operand]]:
    """Begin a function that is launched on the GPU; see `control.function`."""
    builder, made = function(module, name, arguments)
    builder.function.calling_convention = "ptx_kernel"
    return builder, made


def bounded(builder: Builder, threads: int) -> None:
    """Promise that a block of the kernel has no more threads, so that each may have more registers.

    Args:
        builder: in the kernel.
        threads: most threads of a block.
    """
    # llvmlite's own `add` knows no attributes with a value.
    set.add(builder.function.attributes, f'"nvvm.maxntid"="{threads}"')
    # LLVM up to version 20 reads the same promise from an annotation.
    module = builder.module
    promise = [builder.function, ir.MetaDataString(module, "maxntidx"), INDEX(threads)]
    module.add_named_metadata("nvvm.annotations", promise)


def thread_index(builder: Builder) -> Operand:
    """Number of the thread among all that are launched, 64 bits: block * threads + thread."""
    block, size, thread = (
        builder.zext(_register(builder, name), INTEGER) for name in ("ctaid", "ntid", "tid")
    )
    return builder.add(builder.mul(block, size), thread)


def thread_count(builder: Builder) -> Operand:
    """How many threads are launched, 64 bits: blocks * threads."""
    blocks, size = (builder.zext(_register(builder, name), INTEGER) for name in ("nctaid", "ntid"))
    return builder.mul(blocks, size)


def warp_any(builder: Builder, truth: Operand) -> Operand:
    """Write whether a condition holds in any thread of a warp; all threads must execute it."""
    return _call(builder, "vote.any.sync", TRUTH, _ALL, truth)


def warp_meet(builder: Builder) -> None:
    """Write a barrier for all threads of a warp, after which each sees the others' writes."""
    _call(builder, "bar.warp.sync", ir.VoidType(), _ALL)


class Turns:
    """Counter that gives the numbers 0, 1, 2, ... to the threads of a warp, in order of request.

    Args:
        builder: in the kernel, where all threads come; the first numbers up to `first` are taken.
        threads: most threads of a block.
        first: first number to hand out.
    """

    def __init__(self, builder: Builder, threads: int, first: int) -> None:
        kind = ir.ArrayType(INDEX, -(-threads // WARP))
        shared: Any = ir.GlobalVariable(builder.module, kind, "turns", addrspace=_SHARED)
        shared.linkage = "internal"
        shared.initializer = ir.Constant(kind, ir.Undefined)
        own = builder.udiv(_register(builder, "tid"), ir.Constant(INDEX, WARP))
        self._builder = builder
        self._next = builder.gep(shared, [ir.Constant(INDEX, 0), own], inbounds=True)
        builder.store(ir.Constant(INDEX, first), self._next)
        warp_meet(builder)

    def take(self) -> Operand:
        """The next number, 64 bits."""
        taken = self._builder.atomic_rmw("add", self._next, ir.Constant(INDEX, 1), "monotonic")
        return self._builder.zext(taken, INTEGER)


def _register(builder: Builder, name: str) -> Operand:
    return _call(builder, f"read.ptx.sreg.{name}.x", INDEX)


def _call(builder: Builder, name: str, returns: ir.Type, *arguments: Operand) -> Operand:
    full = f"llvm.nvvm.{name}"
    called = builder.module.globals.get(full)
    if called is None:
        kind = ir.FunctionType(returns, [argument.type for argument in arguments])
        called = ir.Function(builder.module, kind, full)
    return builder.call(called, arguments)


def ptx(module: ir.Module | str, arch: str = "sm_90") -> str:
    """PTX text of a module.

    Args:
        module: LLVM module, or its text.
        arch: oldest architecture that it is to run on.
    """
    parsed = llvm.parse_assembly(str(module))
    machine = _machine(arch)
    parsed.triple = _TRIPLE
    parsed.data_layout = str(machine.target_data)
    parsed.verify()
    return machine.emit_assembly(optimise(parsed, machine))


@cache
def _machine(arch: str) -> llvm.TargetMachine:
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(_TRIPLE)
    return target.create_target_machine(cpu=arch, opt=3, codemodel="default")
