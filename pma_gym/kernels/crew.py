"""Threads that run one compiled function together, awake between calls.

A thread that sleeps is awakened on the processor of the one that calls it, and waits there until
that is done: too late for work of less than a millisecond. So these look for work for a while
before they sleep, in compiled code, without Python's lock. What a thread has not taken on when
the one that calls has done its own part, that one does too: a busy machine holds up nobody.
"""

import ctypes
import os
import threading
import weakref
from collections.abc import Sequence
from functools import cache

import numpy as np
from llvmlite import ir

from pma_gym.kernels.control import (
    INTEGER,
    POINTER,
    Builder,
    Operand,
    function,
    integer,
    loop,
    offset,
    repeat,
    variable,
    wait,
)
from pma_gym.kernels.native import Library, compiled

SPINS = 100_000
"""Looks for work before a thread sleeps: 0.1 to 0.3 ms."""

BEGUN, ARGUMENTS, RESULT, DONE, CLAIMED = 0, 1, 8, 16, 24
"""Places of a hand's numbers, in lines of the cache of their own: how many works have been given,
the address of its arguments, the last work's result, how many works are done, and how many someone
has taken on."""

_POINTER, _INTEGER = ctypes.c_void_p, ctypes.c_int64


class Crew:
    """Runs a compiled function, once for each part of some work, all at once.

    Args:
        address: address of a function of one pointer that returns a 64-bit integer.
        parts: its arguments for each part; the first is done by the thread that calls.
    """

    def __init__(self, address: int, parts: Sequence[np.ndarray]) -> None:
        """Start a thread for every part but the first."""
        self._parts, self._address = list(parts), address
        kinds = [_POINTER, _INTEGER, _INTEGER, _POINTER]
        self._lead = _library().function("lead", kinds, _INTEGER)
        self._begin()

    def _begin(self) -> None:
        self._process = os.getpid()
        self._hands = [_Hand(self._address, part) for part in self._parts[1:]]
        self._table = np.array([hand.counts.ctypes.data for hand in self._hands], np.int64)
        self._call = (
            self._table.ctypes.data,
            len(self._hands),
            self._address,
            self._parts[0].ctypes.data,
        )
        # Threads know nothing of the crew, so that it can be forgotten, and they with it.
        self.close = weakref.finalize(self, _dismiss, self._hands)
        self.close.atexit = False

    def run(self) -> int:
        """Do all parts; the bits of what the function returned, together."""
        if self._hands:
            # A process that was forked from this one has the hands but not their threads.
            if self._process != os.getpid() or not self.close.alive:
                self._begin()
            for hand in self._hands:
                # Announced first: a thread that is about to sleep looks at this once more.
                hand.wanted = int(hand.counts[DONE]) + 1
                if hand.asleep:
                    hand.bell.set()
        return self._lead(*self._call)


class _Hand:
    """A thread that waits for work, awake for a while and then asleep.

    Attributes:
        counts: its numbers.
        wanted: number of works that there are to do, also those that begin at once.
        asleep: whether it waits for the bell.
        dismissed: whether it is to end.
        bell: awakens it.
    """

    def __init__(self, address: int, arguments: np.ndarray) -> None:
        self.counts = np.zeros(32, np.int64)
        self.counts[ARGUMENTS] = arguments.ctypes.data
        self.wanted = 0
        self.asleep = self.dismissed = False
        self.bell = threading.Event()
        kinds = [_POINTER, _INTEGER, _POINTER, _INTEGER]
        self._serve = _library().function("serve", kinds, _INTEGER)
        self._arguments = arguments
        self._call = (self.counts.ctypes.data, address, arguments.ctypes.data, SPINS)
        threading.Thread(target=self._work, daemon=True).start()

    def _work(self) -> None:
        while not self.dismissed:
            done = self._serve(*self._call)
            self.bell.clear()
            self.asleep = True
            # Work may have been announced between the last look and the line above.
            if self.wanted == done and not self.dismissed:
                self.bell.wait()
            self.asleep = False


def _dismiss(hands: Sequence[_Hand]) -> None:
    for hand in hands:
        hand.dismissed = True
        hand.bell.set()


@cache
def _library() -> Library:
    return compiled(["crew"], _build, "crew")


def _build() -> ir.Module:
    module = ir.Module()
    _write_serve(module)
    _write_lead(module)
    return module


def _at(b: Builder, counts: Operand, place: int) -> Operand:
    where = offset(b, counts, place, INTEGER)
    # llvmlite stores atomically through pointers that know what they lead to only.
    where.type = ir.PointerType(INTEGER)
    return where


def _now(b: Builder, counts: Operand, place: int) -> Operand:
    return b.load_atomic(_at(b, counts, place), "acquire", 8, typ=INTEGER)


def _write_serve(module: ir.Module) -> None:
    """Work whenever there is any; return the number of works done once there is none for long."""
    b, (counts, address, arguments, spins) = function(
        module,
        "serve",
        [("counts", POINTER), ("address", INTEGER), ("arguments", POINTER), ("spins", INTEGER)],
        INTEGER,
    )
    left = variable(b, INTEGER, spins)
    with repeat(b) as leave_if:
        seen = _now(b, counts, DONE)
        work = b.icmp_signed("!=", _now(b, counts, BEGUN), seen)
        with b.if_else(work) as (yes, no):
            with yes:
                done = b.add(seen, integer(1))
                with b.if_then(_claim(b, counts, done)):
                    b.store(_called(b, address, arguments), _at(b, counts, RESULT))
                    b.store_atomic(done, _at(b, counts, DONE), "release", 8)
                b.store(spins, left)
            with no:
                b.store(b.sub(b.load(left, typ=INTEGER), integer(1)), left)
        leave_if(b.icmp_signed("<=", b.load(left, typ=INTEGER), integer(0)))
    b.ret(_now(b, counts, DONE))


def _write_lead(module: ir.Module) -> None:
    """Begin all hands' work, do one's own and what no hand has taken on, wait for the rest."""
    b, (table, hands, address, arguments) = function(
        module,
        "lead",
        [("table", POINTER), ("hands", INTEGER), ("address", INTEGER), ("arguments", POINTER)],
        INTEGER,
    )

    def counts_of(k: Operand) -> Operand:
        return b.inttoptr(b.load(offset(b, table, k, INTEGER), typ=INTEGER), POINTER)

    with loop(b, hands) as k:
        counts = counts_of(k)
        begun = b.add(_now(b, counts, BEGUN), integer(1))
        b.store_atomic(begun, _at(b, counts, BEGUN), "release", 8)
    result = variable(b, INTEGER, _called(b, address, arguments))
    with loop(b, hands) as k:
        counts = counts_of(k)
        begun = _now(b, counts, BEGUN)
        with b.if_then(_claim(b, counts, begun)):
            given = b.load(_at(b, counts, ARGUMENTS), typ=INTEGER)
            b.store(_called(b, address, b.inttoptr(given, POINTER)), _at(b, counts, RESULT))
            b.store_atomic(begun, _at(b, counts, DONE), "release", 8)
        with wait(b) as leave_if:
            leave_if(b.icmp_signed("==", _now(b, counts, DONE), begun))
        its = b.load(_at(b, counts, RESULT), typ=INTEGER)
        b.store(b.or_(b.load(result, typ=INTEGER), its), result)
    b.ret(b.load(result, typ=INTEGER))


def _claim(b: Builder, counts: Operand, work: Operand) -> Operand:
    """Take a work on, if nobody has; whether it is one's own now."""
    free = b.sub(work, integer(1))
    tried = b.cmpxchg(_at(b, counts, CLAIMED), free, work, "acq_rel", "acquire")
    return b.extract_value(tried, 1)


def _called(b: Builder, address: Operand, arguments: Operand) -> Operand:
    kind = ir.FunctionType(INTEGER, [POINTER])
    return b.call(b.inttoptr(address, ir.PointerType(kind)), [arguments])
