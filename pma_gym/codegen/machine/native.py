"""Compile LLVM modules for the present processor, cache the result on disk, and call it.

Compiled functions as Python builtins.

A call through ctypes costs as much as a tenth of a control step, and numbers that Python puts into
a dictionary cost more. A function that is called as `len` is, and makes its result by Python's C
interface, costs neither. It uses nothing but the part of that interface which stays (PEP 384).
"""

import ctypes
import gc
import itertools
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import llvmlite
import llvmlite.binding as llvm

from pma_gym.codegen.cache.compile_cache import digest, keep, load, source_digest

if TYPE_CHECKING:
    # Not at run time: what is kept on disk loads without it, and faster.
    from llvmlite import ir


INTERFACE = {
    "PyDict_Copy": "pp",
    "PyDict_SetItem": "nppp",
    "PyEval_RestoreThread": "vp",
    "PyEval_SaveThread": "p",
    "PyFloat_FromDouble": "pd",
    "PyLong_AsVoidPtr": "pp",
    "PyLong_FromLongLong": "pi",
    "PyObject_CallNoArgs": "pp",
    "PyTuple_GetItem": "ppi",
    "PyTuple_New": "pi",
    "PyTuple_SetItem": "npip",
    "PyType_GenericAlloc": "ppi",
    "Py_DecRef": "vp",
    "Py_IncRef": "vp",
}
"""Functions that compiled code may call: types of the result and of the arguments, where p is a
pointer, i an integer of 64 bits, n one of 32, d a double and v nothing."""

_ONE_ARGUMENT = 8
"""METH_O."""


class _Definition(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


@cache
def addresses() -> dict[str, int]:
    """Address of every function of the interface."""
    symbols = {name: getattr(ctypes.pythonapi, name) for name in INTERFACE}
    return {name: ctypes.cast(one, ctypes.c_void_p).value or 0 for name, one in symbols.items()}


def builtin(address: int, name: str, bound: object) -> Callable[[Any], Any]:
    """Make a builtin of one argument from a compiled function.

    Args:
        address: of a function of two pointers, `bound` and the argument, which returns a new
            reference, or none and an exception set. The caller keeps its library in memory.
        name: its name in messages.
        bound: what it is given.
    """
    # Of its own: who else uses ctypes.pythonapi shares the types of what is taken from there.
    kind = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    make = kind(("PyCFunction_NewEx", ctypes.pythonapi))
    return make(ctypes.addressof(_definition(address, name)), bound, None)


@cache
def _definition(address: int, name: str) -> _Definition:
    """What says how a function is called; it is read as long as the function lives."""
    return _Definition(name.encode(), address, _ONE_ARGUMENT, None)


_OPTIMISATION = 3

_PASSES = ("sroa", "new_gvn", "instruction_combine", "simplify_cfg")
"""LLVM's passes. The code is straight-line arithmetic that is already vectorised and simplified:
all passes take 0.25 s more for an environment without a gain (0.98 to 1.02 of the time of a step,
in a batch and for a single environment; EPYC, Zen 3, interleaved)."""

_BRIEF = tuple(name for name in _PASSES if name != "new_gvn")
"""Passes where compiling takes longer than what is compiled."""

_libraries: dict[str, "Library"] = {}
_numbers = itertools.count()


class Library:
    """Compiled functions in memory, for the life of the process.

    Args:
        module: LLVM module, or its text.
        name: name in messages.

    Attributes:
        name: its name.
        was_kept: whether it came from the disk.

    Example:
        >>> from llvmlite import ir
        >>> from pma_gym.codegen.machine.control import DOUBLE, function
        >>> module = ir.Module()
        >>> builder, (x,) = function(module, "twice", [("x", DOUBLE)], DOUBLE)
        >>> _ = builder.ret(builder.fadd(x, x))
        >>> Library(module).function("twice", [ctypes.c_double], ctypes.c_double)(1.5)
        3.0
    """

    def __init__(self, module: "ir.Module | str", name: str = "kernels") -> None:
        text = str(module)
        code, self.was_kept = _kept(digest((text, *_machine_key())), lambda: object_code(text))
        self._link(code, name)

    @classmethod
    def from_object(cls, code: bytes, name: str = "kernels", was_kept: bool = False) -> "Library":
        """The functions of object code."""
        library = cls.__new__(cls)
        library.was_kept = was_kept
        library._link(code, name)
        return library

    def _link(self, code: bytes, name: str) -> None:
        self.name = name
        # The number is there because a process may have several libraries of one name.
        self._unit = f"{name}.{next(_numbers)}"
        parts = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
        for function, address in addresses().items():
            parts.import_symbol(function, address)
        _alive.append(parts.link(_jit(), self._unit))

    def address(self, name: str) -> int:
        """Address of a function.

        Raises:
            KeyError: there is none of this name.
        """
        try:
            address = _jit().lookup(self._unit, name)
        except RuntimeError as error:
            raise KeyError(f"no function {name} in library {self.name}: {error}") from error
        _alive.append(address)
        return address[name]

    def function(
        self,
        name: str,
        arguments: Sequence[Any],
        returns: Any = None,  # noqa: ANN401
    ) -> Callable:
        """A function to be called from Python; it lets other threads run meanwhile.

        Args:
            name: its name in the module.
            arguments: ctypes type of each argument: c_void_p for pointers (give
                `array.ctypes.data`), c_int64, c_double.
            returns: ctypes type of the result.
        Raises:
            KeyError: there is none of this name.
        """
        return ctypes.CFUNCTYPE(returns, *arguments)(self.address(name))


_alive: list[Any] = []
"""References that keep compiled code loaded."""


def compiled(
    key_parts: Sequence[str],
    build: "Callable[[], ir.Module | str]",
    name: str = "kernels",
    brief: bool = False,
) -> Library:
    """Return the library that `build` describes, from memory or disk if it exists there.

    Args:
        key_parts: all that the module depends on beside the texts of this library's modules, such
            as the names of a model's effects.
        build: makes the module; only called if the library is not kept.
        name: name in messages.
        brief: compile it with the fewest passes: in 0.93 of the time for a plant's trials (EPYC, in
            turns), for code that takes up to 1.03 of it.
    """
    key = digest((source_digest(), *_machine_key(), str(brief), *key_parts))
    if key not in _libraries:
        code, was_kept = _kept(key, lambda: _made(build, brief))
        _libraries[key] = Library.from_object(code, name, was_kept)
    return _libraries[key]


def _made(build: "Callable[[], ir.Module | str]", brief: bool) -> bytes:
    """Machine code of what `build` makes.

    Python does not look for garbage meanwhile: a module is so many objects that it would look over
    and over, also through all that others have loaded. With PyTorch and Matplotlib there that takes
    a sixth of the time.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        return object_code(str(build()), brief)
    finally:
        if collects:
            gc.enable()


def _kept(key: str, make: Callable[[], bytes]) -> tuple[bytes, bool]:
    code = load(key)
    if code is not None:
        return code, True
    code = make()
    keep(key, code)
    return code, False


def object_code(text: str, brief: bool = False) -> bytes:
    """Machine code of a module's text; brief: made with the fewest passes."""
    return _machine().emit_object(_optimised(text, _BRIEF if brief else _PASSES))


def assembly(text: str) -> str:
    """Assembly of a module's text, to be read."""
    return _machine().emit_assembly(_optimised(text, _PASSES))


def _optimised(text: str, passes: Sequence[str]) -> llvm.ModuleRef:
    module = llvm.parse_assembly(text)
    module.verify()
    return optimise(module, _machine(), passes)


def optimise(
    module: llvm.ModuleRef, machine: llvm.TargetMachine, passes: Sequence[str] | None = None
) -> llvm.ModuleRef:
    """The module after LLVM's passes, these or all, which keep every bit of its results."""
    options = llvm.create_pipeline_tuning_options(speed_level=_OPTIMISATION)
    # The vectors are in the text already.
    options.loop_vectorization = False
    options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    if passes is None:
        manager = builder.getModulePassManager()
    else:
        manager = llvm.create_new_module_pass_manager()
        for name in passes:
            getattr(manager, f"add_{name}_pass")()
    manager.run(module, builder)
    return module


@cache
def host() -> tuple[str, str]:
    """Name and features of the processor."""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def simd_lanes(single: bool = False) -> int:
    """How many lanes kernels for many plants have: the fastest measured on such a processor.

    One register: more lanes than that take turns in it, and wait longer for each other at the end
    of a batch. With AVX2, which has 16 registers, 16 lanes took 1.4 times as long as 4 (EPYC, Zen
    3); with AVX-512, which has 32, 16 lanes took 1.03 times as long as 8 where many environments
    step, 1.09 times where 64 do (Xeon, Granite Rapids). No bit depends on it.

    Args:
        single: for single precision.
    """
    wide = "+avx512f" in host()[1].split(",")
    return (8 if wide else 4) * (2 if single else 1)


def pairs(width: int) -> bool:
    """Whether kernels for so many plants at once compute each of them twice, as a pair.

    One plant, with AVX-512: truths of scalars go through registers of integers and back. A step
    took 0.96 of the time (Xeon, Granite Rapids). No bit depends on it.
    """
    return width == 1 and "+avx512vl" in host()[1].split(",")


def _machine_key() -> tuple[str, ...]:
    versions = llvmlite.__version__, str(llvm.llvm_version_info), str(_OPTIMISATION)
    return (*versions, llvm.get_process_triple(), *host())


@cache
def _machine() -> llvm.TargetMachine:
    return _new_machine()


def _new_machine() -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    name, features = host()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=name, features=features, opt=_OPTIMISATION, reloc="pic", codemodel="small", jit=True
    )


@cache
def _jit() -> llvm.LLJIT:
    # It takes the machine over. JITLink keeps code and constants near each other.
    return llvm.create_lljit_compiler(_new_machine(), use_jit_link=True)
