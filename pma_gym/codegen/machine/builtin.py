"""Compiled functions as Python builtins.

A call through ctypes costs as much as a tenth of a control step, and numbers that Python puts into
a dictionary cost more. A function that is called as `len` is, and makes its result by Python's C
interface, costs neither. It uses nothing but the part of that interface which stays (PEP 384).
"""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

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
