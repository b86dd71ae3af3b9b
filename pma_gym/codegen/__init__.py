"""Compilation of laws to machine code: traced once, compiled for the processor.

`graph` and `trace` call laws on values instead of numbers and remember the arithmetic; `derivative`
differentiates it; `text` writes it as Python; `llvm` and `control` as LLVM instructions, scalar or
in SIMD lanes; `native` compiles those for the processor and keeps the result; `random` has random
numbers that can be traced. A law, in lanes of eight:

    >>> import ctypes
    >>> import numpy as np
    >>> from llvmlite import ir
    >>> from pma_gym.effects.cable.cable import Cable, tension
    >>> from pma_gym.codegen.machine.control import INTEGER, POINTER, function, loop
    >>> from pma_gym.codegen.graph import CHANGING, Graph
    >>> from pma_gym.codegen.machine.simd import SimdEmitter
    >>> from pma_gym.codegen.machine.native import compiled
    >>> from pma_gym.codegen.trace import live_inputs, trace

    >>> graph, cable = Graph(), Cable(stiffness=550e3, damping=19.4, slack=0.85e-3)
    >>> stretch, rate = (graph.input(name, CHANGING) for name in ("stretch", "rate"))
    >>> force = trace(tension, stretch, rate, graph.inputs("cable", cable))
    >>> [value.data for value in live_inputs([force])]
    ['stretch', 'rate', 'cable.stiffness', 'cable.damping', 'cable.slack']

    >>> def build():
    ...     module, simd = ir.Module(), SimdEmitter(8)
    ...     arguments = [("blocks", INTEGER), ("table", POINTER), ("data", POINTER)]
    ...     builder, (blocks, table, data) = function(module, "tension", arguments)
    ...     inputs = live_inputs([force])
    ...     known = {v.id: simd.load(builder, table, i) for i, v in enumerate(inputs[2:])}
    ...     with loop(builder, blocks) as block:
    ...         row = simd.address(builder, data, builder.mul(block, INTEGER(3)))
    ...         known |= {v.id: simd.load(builder, row, i) for i, v in enumerate(inputs[:2])}
    ...         emitted = simd.emit(builder, [force], known)
    ...         simd.store(builder, emitted[force.id], row, 2)
    ...     builder.ret_void()
    ...     return module

    >>> pointer = ctypes.c_void_p
    >>> run = compiled(["example"], build).function("tension", [ctypes.c_int64, pointer, pointer])
    >>> table = np.repeat(np.array(cable), 8)  # [slot, lane]
    >>> data = np.zeros((4, 3, 8))  # [block, slot, lane]
    >>> data[:, 0] = np.linspace(0.0, 2e-3, 32).reshape(4, 8)
    >>> run(4, table.ctypes.data, data.ctypes.data)
    >>> float(data[3, 2, 7].round(3))
    632.5
"""
