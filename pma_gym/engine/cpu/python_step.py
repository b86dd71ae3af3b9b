"""Writes a single environment's step as a builtin, which makes what Gymnasium's `step` returns."""

from llvmlite import ir

from pma_gym.codegen.machine import control
from pma_gym.codegen.machine.control import (
    DOUBLE,
    FLOAT,
    INDEX,
    INTEGER,
    POINTER,
    Builder,
    Operand,
    function,
    integer,
    loop,
    offset,
)
from pma_gym.codegen.machine.native import INTERFACE
from pma_gym.engine.cpu.block_memory import ARGUMENTS
from pma_gym.engine.state_layout import StateLayout

BOUND = (
    *("arguments", "infos", "keys", "copy", "no", "number"),
    *("given", "array", "single", "double"),
)
"""What `advance` is bound to: address of the step's arguments, a dictionary of the info's keys, the
keys of its numbers in order, what copies the observation, False and NumPy's type of numbers; the
array of actions, the type of arrays (None where no action is to be read here), and the dtypes of
single and double precision."""

VALUE = float.__basicsize__ - 8
"""Byte offset of the value in a float object, and in NumPy's float64, which inherits from it."""

NOT_READ = 8
"""What `advance` returns for an action that is to be read in Python; nothing has happened then."""

_TYPES = {"p": POINTER, "i": INTEGER, "n": INDEX, "d": DOUBLE, "v": ir.VoidType()}


def write_python_step(module: ir.Module, state_layout: StateLayout) -> None:
    """Write `advance`, which makes a step by the module's own `check` and `step`.

    Its argument is the action: an array of one dimension and of single or double precision with an
    entry for each action, or the array of actions itself, in which the action stands already. It
    returns observation, reward, False, False and info, or what one of those two returns if that is
    not 0, or NOT_READ. Other threads of Python run meanwhile.

    Args:
        module: where to.
        state_layout: places of a single environment's numbers.
    """
    b, (bound, action) = function(
        module, "advance", [("bound", POINTER), ("action", POINTER)], POINTER
    )
    parts = {name: _call(b, "PyTuple_GetItem", bound, integer(i)) for i, name in enumerate(BOUND)}
    arguments = _call(b, "PyLong_AsVoidPtr", parts["arguments"])
    with b.if_then(b.icmp_unsigned("!=", action, parts["given"])):
        at = offset(b, arguments, ARGUMENTS.index("actions"), INTEGER)
        given = b.inttoptr(b.load(at, typ=INTEGER), POINTER)
        _read(b, action, parts, given, state_layout.actions)
    bad = b.call(module.get_global("check"), [arguments])
    with b.if_then(b.icmp_signed("!=", bad, integer(0)), likely=False):
        b.ret(_call(b, "PyLong_FromLongLong", bad))
    thread = _call(b, "PyEval_SaveThread")
    ended = b.call(module.get_global("step"), [arguments, ir.Constant(POINTER, None)])
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
    for i, key in enumerate(state_layout.info):
        number = b.load(offset(b, records, state_layout.offsets[key]), typ=DOUBLE)
        value = _call(b, "PyType_GenericAlloc", parts["number"], integer(0))
        _unless(b, _is_null(b, value), lost)
        b.store(number, offset(b, value, VALUE, ir.IntType(8)))
        name = _call(b, "PyTuple_GetItem", parts["keys"], integer(i))
        failed = _call(b, "PyDict_SetItem", info, name, value)
        _call(b, "Py_DecRef", value)
        _unless(b, b.icmp_signed("!=", failed, ir.Constant(INDEX, 0)), lost)
    number = b.load(offset(b, records, state_layout.offsets["reward"]), typ=DOUBLE)
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


def _read(
    b: Builder, action: Operand, parts: dict[str, Operand], given: Operand, count: int
) -> None:
    """Write an action's entries where the step takes them, or return NOT_READ."""
    unread = b.append_basic_block("unread")

    def member(place: int, type_: ir.Type = POINTER) -> Operand:
        return b.load(offset(b, action, place, ir.IntType(8)), typ=type_)

    def is_same(pointer: Operand, name: str) -> Operand:
        return b.icmp_unsigned("==", pointer, parts[name])

    _unless(b, b.not_(is_same(member(control.TYPE), "array")), unread)
    dtype = member(control.DTYPE)
    is_single = is_same(dtype, "single")
    _unless(b, b.not_(b.or_(is_single, is_same(dtype, "double"))), unread)
    dimensions = member(control.DIMENSIONS, INDEX)
    _unless(b, b.icmp_signed("!=", dimensions, ir.Constant(INDEX, 1)), unread)
    size = b.load(member(control.SIZES), typ=INTEGER)
    _unless(b, b.icmp_signed("!=", size, integer(count)), unread)
    data, stride = member(control.DATA), b.load(member(control.STRIDES), typ=INTEGER)
    with b.if_else(is_single) as cases:
        for case, element in zip(cases, (FLOAT, DOUBLE), strict=True):
            with case, loop(b, count) as i:
                at = offset(b, data, b.mul(i, stride), ir.IntType(8))
                # Wherever it lies: an array may begin at any byte.
                entry = b.load(at, align=1, typ=element)
                wide = b.fpext(entry, DOUBLE) if element is FLOAT else entry
                b.store(wide, offset(b, given, i))
    read = b.append_basic_block("read")
    b.branch(read)
    b.position_at_end(unread)
    b.ret(_call(b, "PyLong_FromLongLong", integer(NOT_READ)))
    b.position_at_end(read)


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
