"""Threads that run compiled functions together, awake between calls.

A thread that sleeps is awakened on the processor of the one that calls it, and waits there until
that is done: too late for work of less than a millisecond. So these look for work for a while
before they sleep, in compiled code, without Python's lock.

Every thread has a share of the work, in parts. Who is done with its own takes what others have not
begun, so that a processor that is slower for a while, or does something else, holds up nobody. The
function itself may take further parts before it is done with the first (`write_another`).

Threads that share a piece of work whose compiled parts let each other run.
"""

import ctypes
import os
import threading
import weakref
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from llvmlite import ir
from threadpoolctl import threadpool_limits

from pma_gym.codegen.machine.control import (
    INTEGER,
    POINTER,
    Builder,
    Operand,
    atomic,
    function,
    integer,
    loop,
    offset,
    repeat,
    variable,
    wait,
)
from pma_gym.codegen.machine.native import Library, compiled

SPINS = 100_000
"""Looks for work before a thread sleeps: 0.1 to 0.3 ms."""

TAKEN, GIVEN, DONE, RESULT, PARTS, ARGUMENTS, FUNCTION, SHARE = 0, 8, 16, 17, 24, 25, 26, 32
"""Places of a share's numbers, in lines of the cache of their own, and how many there are: parts
that someone has taken on, that have been given, and that are done, all since the beginning; what
the function returned; how many parts there are, the address of the addresses of their arguments,
and that of the function."""

ANOTHER, SHARES, THREADS, OWN, FROM = range(5)
"""What a thread keeps while it works, in 64-bit integers: address of the function that takes
another part, address and number of the shares, its own, and address of the share that it took a
part from last."""

Work = tuple[int, Sequence[Sequence[np.ndarray]]]
"""Address of a function of two pointers, the arguments of a part and what `write_another` asks for,
that returns a 64-bit integer; and its arguments for each part of every thread's share, first of the
thread that calls."""

_POINTER, _INTEGER = ctypes.c_void_p, ctypes.c_int64


class ThreadPool:
    """Runs compiled functions on all parts of some work, in several threads.

    Args:
        works: one or more, with a share for each thread.
    """

    def __init__(self, *works: Work) -> None:
        """Start a thread for every share but the first."""
        self._works = works
        self._lead = _library().function("lead", [_POINTER, _POINTER, _INTEGER], _INTEGER)
        self._begin()

    def _begin(self) -> None:
        self._process = os.getpid()
        self._board = _Board(self._works)
        self._workers = [_Worker(self._board, own) for own in range(1, self._board.threads)]
        # Threads know nothing of the pool, so that it can be forgotten, and they with it.
        self.close = weakref.finalize(self, _dismiss, self._workers)
        self.close.atexit = False

    def run(self, work: int = 0) -> int:
        """Do all parts of a work; the bits of what its function returned, together."""
        # A process that was forked from this one has the workers but not their threads.
        if self._workers and (self._process != os.getpid() or not self.close.alive):
            self._begin()
        if work != self._board.ready:
            self._board.prepare(work)
        if self._workers:
            # Announced first: a thread that is about to sleep looks at this once more.
            self._board.announce()
            for worker in self._workers:
                if worker.asleep:
                    worker.wake.set()
        return self._lead(*self._board.call)


class _Board:
    """The work, as all threads see it.

    Attributes:
        threads: how many there are.
        announced: number of works that there are to do, also those that begin at once.
        ready: the work that they would do.
        call: the first arguments of `lead` and `serve`.
    """

    def __init__(self, works: Sequence[Work]) -> None:
        self._arguments = works
        self._tables = [
            [np.array([part.ctypes.data for part in share], np.int64) for share in shares]
            for _, shares in works
        ]
        self._parts = [
            np.array([(len(table), table.ctypes.data, address) for table in tables], np.int64)
            for (address, _), tables in zip(works, self._tables, strict=True)
        ]
        self.threads = len(self._tables[0])
        self._works = np.zeros(SHARE, np.int64)
        self._numbers = np.zeros((self.threads, SHARE), np.int64)
        self.announced = 0
        self.call = self._works.ctypes.data, self._numbers.ctypes.data, self.threads
        self.prepare(0)

    def prepare(self, work: int) -> None:
        """Have that work done from now on; nobody looks at it before the next is announced."""
        self._numbers[:, PARTS : FUNCTION + 1] = self._parts[work]
        self.ready = work

    def announce(self) -> None:
        """There is one more work to do than were begun; again, should Ctrl-C come before that."""
        self.announced = int(self._works[0]) + 1


class _Worker:
    """A thread that waits for work, awake for a while and then asleep.

    Attributes:
        asleep: whether it waits for the wake.
        dismissed: whether it is to end.
        wake: awakens it.
    """

    def __init__(self, board: _Board, own: int) -> None:
        self._board = board
        self.asleep = self.dismissed = False
        self.wake = threading.Event()
        kinds = [_POINTER, _POINTER, *[_INTEGER] * 4]
        self._serve = _library().function("serve", kinds, _INTEGER)
        self._own = own
        threading.Thread(target=self._work, daemon=True).start()

    def _work(self) -> None:
        seen = 0
        while not self.dismissed:
            seen = self._serve(*self._board.call, self._own, SPINS, seen)
            self.wake.clear()
            self.asleep = True
            # Work may have been announced between the last look and the line above.
            if self._board.announced == seen and not self.dismissed:
                self.wake.wait()
            self.asleep = False


def _dismiss(workers: Sequence[_Worker]) -> None:
    for worker in workers:
        worker.dismissed = True
        worker.wake.set()


@cache
def _library() -> Library:
    return compiled(["thread pool"], _build, "thread pool")


def _build() -> ir.Module:
    module = ir.Module()
    _write_take(module)
    _write_work(module)
    _write_serve(module)
    _write_lead(module)
    return module


_BOARD = [("works", POINTER), ("shares", POINTER), ("threads", INTEGER)]


def _now(b: Builder, numbers: Operand, place: int) -> Operand:
    return b.load_atomic(atomic(b, numbers, place), "acquire", 8, typ=INTEGER)


def _share(b: Builder, shares: Operand, number: Operand) -> Operand:
    return offset(b, shares, b.mul(number, integer(SHARE)), INTEGER)


def write_another(b: Builder, pool: Operand) -> Operand:
    """Write the taking of another part in the midst of one; address of its arguments, 0 for none.

    It is to be done before the function returns, whose result is that of both.

    Args:
        b: where to write.
        pool: the function's second argument.
    """
    kind = ir.PointerType(ir.FunctionType(INTEGER, [POINTER]))
    address = b.load(offset(b, pool, ANOTHER, INTEGER), typ=INTEGER)
    return b.call(b.inttoptr(address, kind), [pool])


def _write_take(module: ir.Module) -> None:
    """Take a part on that nobody has, one's own share first; 0 if there is none."""
    b, (pool,) = function(module, "take", [("thread pool", POINTER)], INTEGER)
    shares, threads, own = (
        b.load(offset(b, pool, place, INTEGER), typ=INTEGER) for place in (SHARES, THREADS, OWN)
    )
    part, asked = variable(b, INTEGER, integer(0)), variable(b, INTEGER, integer(0))
    with repeat(b) as leave_if:
        number = b.load(asked, typ=INTEGER)
        leave_if(b.icmp_signed(">=", number, threads))
        whose = b.srem(b.add(own, number), threads)
        share = _share(b, b.inttoptr(shares, POINTER), whose)
        end = _now(b, share, GIVEN)
        taken = _now(b, share, TAKEN)
        with b.if_else(b.icmp_signed("<", taken, end)) as (some, none):
            with some:
                more = b.add(taken, integer(1))
                tried = b.cmpxchg(atomic(b, share, TAKEN), taken, more, "acq_rel", "acquire")
                with b.if_then(b.extract_value(tried, 1)):
                    b.store(_arguments(b, share, b.sub(taken, end)), part)
                    b.store(b.ptrtoint(share, INTEGER), offset(b, pool, FROM, INTEGER))
            with none:
                b.store(b.add(number, integer(1)), asked)
        leave_if(b.icmp_signed("!=", b.load(part, typ=INTEGER), integer(0)))
    b.ret(b.load(part, typ=INTEGER))
    # The part in whose midst it is taken is not done before both are.
    b, (pool,) = function(module, "another", [("thread pool", POINTER)], INTEGER)
    part = b.call(module.get_global("take"), [pool])
    with b.if_then(b.icmp_signed("!=", part, integer(0))):
        _done(b, pool)
    b.ret(part)


def _arguments(b: Builder, share: Operand, before_end: Operand) -> Operand:
    """Address of a part's arguments, counted from the end of its share."""
    number = b.add(b.load(atomic(b, share, PARTS), typ=INTEGER), before_end)
    table = b.inttoptr(b.load(atomic(b, share, ARGUMENTS), typ=INTEGER), POINTER)
    return b.load(offset(b, table, number, INTEGER), typ=INTEGER)


def _from(b: Builder, pool: Operand) -> Operand:
    return b.inttoptr(b.load(offset(b, pool, FROM, INTEGER), typ=INTEGER), POINTER)


def _done(b: Builder, pool: Operand) -> None:
    b.atomic_rmw("add", atomic(b, _from(b, pool), DONE), integer(1), "release")


def _write_work(module: ir.Module) -> None:
    """Do what nobody has taken on."""
    parameters = [*_BOARD[1:], ("own", INTEGER)]
    b, (shares, threads, own) = function(module, "work", parameters)
    pool = variable(b, ir.ArrayType(INTEGER, FROM + 1))
    pool.type = POINTER
    another = b.ptrtoint(module.get_global("another"), INTEGER)
    for place, value in (
        (ANOTHER, another),
        (SHARES, b.ptrtoint(shares, INTEGER)),
        (THREADS, threads),
        (OWN, own),
    ):
        b.store(value, offset(b, pool, place, INTEGER))
    kind = ir.PointerType(ir.FunctionType(INTEGER, [POINTER, POINTER]))
    with repeat(b) as leave_if:
        part = b.call(module.get_global("take"), [pool])
        leave_if(b.icmp_signed("==", part, integer(0)))
        share = _from(b, pool)
        # Not before there is a part: the next work may have begun, which is another.
        work = b.inttoptr(b.load(atomic(b, share, FUNCTION), typ=INTEGER), kind)
        result = b.call(work, [b.inttoptr(part, POINTER), pool])
        b.atomic_rmw("or", atomic(b, share, RESULT), result, "monotonic")
        b.atomic_rmw("add", atomic(b, share, DONE), integer(1), "release")
    b.ret_void()


def _write_serve(module: ir.Module) -> None:
    """Work whenever there is any; return the number of works seen once there is none for long."""
    parameters = [*_BOARD, ("own", INTEGER), ("spins", INTEGER), ("seen", INTEGER)]
    b, (works, shares, threads, own, spins, before) = function(module, "serve", parameters, INTEGER)
    left, seen = variable(b, INTEGER, spins), variable(b, INTEGER, before)
    with repeat(b) as leave_if:
        now = _now(b, works, 0)
        there = b.icmp_signed("!=", now, b.load(seen, typ=INTEGER))
        with b.if_else(there) as (yes, no):
            with yes:
                b.store(now, seen)
                b.call(module.get_global("work"), [shares, threads, own])
                b.store(spins, left)
            with no:
                b.store(b.sub(b.load(left, typ=INTEGER), integer(1)), left)
        leave_if(b.icmp_signed("<=", b.load(left, typ=INTEGER), integer(0)))
    b.ret(b.load(seen, typ=INTEGER))


def _write_lead(module: ir.Module) -> None:
    """Give all parts, work, wait for the rest."""
    b, (works, shares, threads) = function(module, "lead", _BOARD, INTEGER)
    with loop(b, threads) as k:
        share = _share(b, shares, k)
        b.store(integer(0), atomic(b, share, RESULT))
        more = b.load(atomic(b, share, PARTS), typ=INTEGER)
        b.store_atomic(b.add(_now(b, share, GIVEN), more), atomic(b, share, GIVEN), "release", 8)
    b.store_atomic(b.add(_now(b, works, 0), integer(1)), atomic(b, works, 0), "release", 8)
    b.call(module.get_global("work"), [shares, threads, integer(0)])
    result = variable(b, INTEGER, integer(0))
    with loop(b, threads) as k:
        share = _share(b, shares, k)
        end = _now(b, share, GIVEN)
        with wait(b) as leave_if:
            leave_if(b.icmp_signed("==", _now(b, share, DONE), end))
        its = b.load(atomic(b, share, RESULT), typ=INTEGER)
        b.store(b.or_(b.load(result, typ=INTEGER), its), result)
    b.ret(b.load(result, typ=INTEGER))


def share(work: Callable[[int], object], threads: int, kept: object = None) -> None:
    """Do the parts of a work, the first of them in this thread.

    Args:
        work: does one part, by its number.
        threads: how many parts there are.
        kept: what they write to: it is held until all have ended, should a second Ctrl-C end this
            call before them.
    """

    def one(part: int, _: object) -> None:
        work(part)

    others = [threading.Thread(target=one, args=(k, kept)) for k in range(1, threads)]
    for other in others:
        other.start()
    try:
        work(0)
    finally:
        for other in others:
            other.join()


def linear_algebra_alone() -> threadpool_limits:
    """A context in which NumPy's and SciPy's linear algebra works in the calling thread alone.

    The matrices of a fit are small: threads of OpenBLAS wait for each other longer than they
    compute, in the time of the threads that simulate, and how they share a sum depends on the
    number of cores.
    """
    return threadpool_limits(1, user_api="blas")
