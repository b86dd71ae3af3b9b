"""Writes a single environment's step as a builtin, which makes what Gymnasium's `step` returns."""

from llvmlite import ir

from pma_gym.envs.block_memory import ARGUMENTS
from pma_gym.envs.record import Record
from pma_gym.kernels.builtin import INTERFACE
from pma_gym.kernels.control import (
    DOUBLE,
    INDEX,
    INTEGER,
    POINTER,
    Builder,
    Operand,
    function,
    integer,
    offset,
)

BOUND = ("arguments", "infos", "keys", "copy", "no", "yes")
"""What `advance` is bound to: address of the step's arguments, a dictionary of the info's keys, the
keys in order, what copies the observation, False and True."""

TRUTHS = ("extrapolated",)
"""Keys of an info that are true or false."""

_TYPES = {"p": POINTER, "i": INTEGER, "n": INDEX, "d": DOUBLE, "v": ir.VoidType()}


def write_advance(module: ir.Module, record: Record) -> None:
    """Write `advance`, which makes a step by the module's own `step`.

    It returns observation, reward, False, False and info, or what `step` returns if that is not 0.
    Other threads of Python run meanwhile.

    Args:
        module: where to.
        record: places of a single environment's numbers.
    """
    b, (bound, _) = function(module, "advance", [("bound", POINTER), ("none", POINTER)], POINTER)
    parts = {name: _call(b, "PyTuple_GetItem", bound, integer(i)) for i, name in enumerate(BOUND)}
    arguments = _call(b, "PyLong_AsVoidPtr", parts["arguments"])
    thread = _call(b, "PyEval_SaveThread")
    ended = b.call(module.get_global("step"), [arguments])
    _call(b, "PyEval_RestoreThread", thread)
    with b.if_then(b.icmp_signed("!=", ended, integer(0)), likely=False):
        b.ret(_call(b, "PyLong_FromLongLong", ended))
    observation = _call(b, "PyObject_CallNoArgs", parts["copy"])
    with b.if_then(_is_null(b, observation), likely=False):
        b.ret(_NULL)
    info = _call(b, "PyDict_Copy", parts["infos"])
    lost = b.append_basic_block("lost")
    _unless(b, _is_null(b, info), lost)
    at = offset(b, arguments, ARGUMENTS.index("records"), INTEGER)
    records = b.inttoptr(b.load(at, typ=INTEGER), POINTER)
    for i, key in enumerate(record.info):
        number = b.load(offset(b, records, record.places[key]), typ=DOUBLE)
        if key in TRUTHS:
            truth = b.fcmp_unordered("!=", number, ir.Constant(DOUBLE, 0.0))
            value = b.select(truth, parts["yes"], parts["no"])
            _call(b, "Py_IncRef", value)
        else:
            value = _call(b, "PyFloat_FromDouble", number)
            _unless(b, _is_null(b, value), lost)
        name = _call(b, "PyTuple_GetItem", parts["keys"], integer(i))
        failed = _call(b, "PyDict_SetItem", info, name, value)
        _call(b, "Py_DecRef", value)
        _unless(b, b.icmp_signed("!=", failed, ir.Constant(INDEX, 0)), lost)
    number = b.load(offset(b, records, record.places["reward"]), typ=DOUBLE)
    reward = _call(b, "PyFloat_FromDouble", number)
    _unless(b, _is_null(b, reward), lost)
    made = _call(b, "PyTuple_New", integer(5))
    with b.if_then(_is_null(b, made), likely=False):
        _call(b, "Py_DecRef", reward)
        b.branch(lost)
    _call(b, "Py_IncRef", parts["no"])
    _call(b, "Py_IncRef", parts["no"])
    for i, part in enumerate((observation, reward, parts["no"], parts["no"], info)):
        _call(b, "PyTuple_SetItem", made, integer(i), part)
    b.ret(made)
    b.position_at_end(lost)
    for part in (observation, info):
        _call(b, "Py_DecRef", part)
    b.ret(_NULL)


_NULL = ir.Constant(POINTER, None)


def _is_null(b: Builder, pointer: Operand) -> Operand:
    return b.icmp_unsigned("==", pointer, _NULL)


def _unless(b: Builder, truth: Operand, otherwise: Operand) -> None:
    """Go on unless something is so."""
    on = b.append_basic_block("on")
    b.cbranch(truth, otherwise, on)
    b.position_at_end(on)


def _call(b: Builder, name: str, *arguments: Operand) -> Operand:
    """Call a function of Python's interface."""
    returns, *types = (_TYPES[letter] for letter in INTERFACE[name])
    known = b.module.globals.get(name)
    return b.call(known or ir.Function(b.module, ir.FunctionType(returns, types), name), arguments)
