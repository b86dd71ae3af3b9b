"""Threads that share a compiled function's work: each part once a call, by whoever comes first."""

import gc
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from llvmlite import ir

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
)
from pma_gym.codegen.machine.native import Library, compiled
from pma_gym.codegen.threads.thread_pool import ThreadPool, write_another

COUNTER, SECOND, TIMES = 0, 1, 2


def build() -> ir.Module:
    """Adds the second number to the first, and returns the second; the third is how often."""
    module = ir.Module()
    b, (numbers, _) = function(module, "add", [("numbers", POINTER), ("pool", POINTER)], INTEGER)
    _write_add(b, numbers)
    b, (numbers, _) = function(
        module, "add_often", [("numbers", POINTER), ("pool", POINTER)], INTEGER
    )
    more = b.load(offset(b, numbers, integer(SECOND), INTEGER), typ=INTEGER)
    with loop(b, b.load(offset(b, numbers, integer(TIMES), INTEGER), typ=INTEGER)):
        # Atomic, so that the loop is not reduced to one product.
        b.atomic_rmw("add", atomic(b, numbers, COUNTER), more, "monotonic")
    b.ret(more)
    _write_await_other(module)
    _write_add_all(module)
    return module


def _write_add_all(module: ir.Module) -> None:
    """As "add", and then for every other part that there is to take."""
    both = [("numbers", POINTER), ("pool", POINTER)]
    b, (numbers, pool) = function(module, "add_all", both, INTEGER)
    now = variable(b, INTEGER, b.ptrtoint(numbers, INTEGER))
    bits = variable(b, INTEGER, integer(0))
    with repeat(b) as leave_if:
        part = b.inttoptr(b.load(now, typ=INTEGER), POINTER)
        more = b.load(offset(b, part, integer(SECOND), INTEGER), typ=INTEGER)
        # Atomic, so that a part that two threads do is seen to have been done twice.
        b.atomic_rmw("add", atomic(b, part, COUNTER), more, "monotonic")
        b.store(b.or_(b.load(bits, typ=INTEGER), more), bits)
        b.store(write_another(b, pool), now)
        leave_if(b.icmp_signed("==", b.load(now, typ=INTEGER), integer(0)))
    b.ret(b.load(bits, typ=INTEGER))


def _write_await_other(module: ir.Module) -> None:
    """Raise the flag at one address, wait for that at another; 1 if it is not raised for long."""
    b, (numbers, _) = function(
        module, "await_other", [("numbers", POINTER), ("pool", POINTER)], INTEGER
    )
    mine, other = (
        b.inttoptr(b.load(offset(b, numbers, i, INTEGER), typ=INTEGER), ir.PointerType(INTEGER))
        for i in range(2)
    )
    b.store_atomic(integer(1), mine, "release", 8)
    left = variable(b, INTEGER, integer(10**10))
    with repeat(b) as leave_if:
        leave_if(b.icmp_signed("!=", b.load_atomic(other, "acquire", 8, typ=INTEGER), integer(0)))
        b.store(b.sub(b.load(left, typ=INTEGER), integer(1)), left)
        leave_if(b.icmp_signed("==", b.load(left, typ=INTEGER), integer(0)))
    b.ret(b.zext(b.icmp_signed("==", b.load(left, typ=INTEGER), integer(0)), INTEGER))


def _write_add(b: Builder, numbers: Operand) -> None:
    more = b.load(offset(b, numbers, integer(SECOND), INTEGER), typ=INTEGER)
    where = offset(b, numbers, integer(COUNTER), INTEGER)
    b.store(b.add(b.load(where, typ=INTEGER), more), where)
    b.ret(more)


def library() -> Library:
    return compiled(["test pool"], build, "test")


@pytest.fixture
def pool() -> Iterator[tuple[ThreadPool, list[np.ndarray]]]:
    """Four threads, the parts of their work."""
    parts = [np.array([0, 1 << k], np.int64) for k in range(4)]
    pool = ThreadPool((library().address("add"), [[part] for part in parts]))
    yield pool, parts
    pool.close()


def test_what_no_thread_takes_on_is_done_all_the_same(monkeypatch):
    # As on a machine that is busy with something else: the threads never come.
    monkeypatch.setattr(threading.Thread, "start", lambda _: None)
    parts = [np.array([0, 1 << k], np.int64) for k in range(7)]
    pool = ThreadPool((library().address("add"), [parts[:1], parts[1:3], parts[3:6], parts[6:]]))
    for calls in range(1, 4):
        assert pool.run() == 127
        assert [part[COUNTER] for part in parts] == [calls << k for k in range(7)]


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_works_that_follow_each_other_are_not_mixed_up(threads):
    generator = np.random.default_rng(threads)
    works = []
    for name in ("add", "add_often", "add_all"):
        shares = [
            [
                np.array([0, 1 << int(generator.integers(40)), generator.choice([1, 30, 3000])])
                for _ in range(count)
            ]
            for count in generator.integers(1, 9, threads)
        ]
        works.append((library().address(name), shares))
    pool = ThreadPool(*works)
    parts = [[part for share in shares for part in share] for _, shares in works]
    calls = np.zeros(3, int)
    for which in generator.integers(3, size=2000):
        bits = int(np.bitwise_or.reduce([part[SECOND] for part in parts[which]]))
        assert pool.run(which) == bits
        calls[which] += 1
        for number, own, often in zip(calls, parts, (False, True, False), strict=True):
            for part in own:
                assert part[COUNTER] == number * part[SECOND] * (part[TIMES] if often else 1)
    pool.close()


def test_who_is_done_takes_what_another_has_not_begun():
    # The second share's first part ends when its second has begun: somebody else must do that.
    flags = np.zeros((3, 8), np.int64)
    alone, first, second = (
        np.array([flags[mine].ctypes.data, flags[other].ctypes.data])
        for mine, other in ((0, 0), (1, 2), (2, 2))
    )
    pool = ThreadPool((library().address("await_other"), [[alone], [first, second]]))
    for _ in range(50):
        flags[:] = 0
        assert pool.run() == 0, "waited in vain"
        assert flags[:, 0].tolist() == [1, 1, 1]
    pool.close()


def test_threads_that_sleep_wake_up(pool):
    pool, parts = pool
    before = sys.getswitchinterval()
    # Short turns and all kinds of pauses: a thread is caught at every stage of falling asleep.
    sys.setswitchinterval(1e-6)
    try:
        pauses = np.random.default_rng(0).uniform(0.0, 2e-3, 200)
        for pause in pauses:
            time.sleep(pause)
            assert pool.run() == 15
    finally:
        sys.setswitchinterval(before)
    assert parts[3][COUNTER] == 1600


def test_what_was_announced_and_never_begun_keeps_nobody_awake(pool):
    pool, _ = pool
    # As if Ctrl-C came between the two.
    pool._board.announce()
    assert pool.run() == pool.run() == 15
    time.sleep(0.2)
    before = time.process_time()
    time.sleep(0.3)
    assert time.process_time() - before < 0.1
    assert pool.run() == 15


@pytest.fixture
def begun() -> Callable[[], list[threading.Thread]]:
    """Threads that have begun since."""
    before = set(threading.enumerate())
    return lambda: [thread for thread in threading.enumerate() if thread not in before]


def test_a_crew_of_one_needs_no_thread(begun):
    assert ThreadPool((library().address("add"), [[np.array([0, 3], np.int64)]])).run() == 3
    assert not begun()


@pytest.mark.parametrize("asleep", [False, True])
def test_threads_end_with_their_crew(begun, asleep):
    pool = ThreadPool((library().address("add"), [[np.ones(2, np.int64)] for _ in range(3)]))
    pool.run()
    threads = begun()
    assert len(threads) == 2
    time.sleep(0.2 if asleep else 0.0)
    del pool
    gc.collect()
    for thread in threads:
        thread.join(10.0)
    assert not begun()


def test_a_closed_crew_begins_again(begun):
    pool = ThreadPool((library().address("add"), [[np.ones(2, np.int64)] for _ in range(3)]))
    for _ in range(2):
        assert pool.run() == 1
        threads = begun()
        assert len(threads) == 2
        pool.close()
        for thread in threads:
            thread.join(10.0)
        assert not begun()


FORK = """
import os, warnings
import numpy as np
from pma_gym.envs import PMAVectorEnv
warnings.simplefilter("ignore")
envs = PMAVectorEnv(32, model="cascade", threads=2, pressure_kpa=300)
envs.reset(seed=0)
envs.step(np.zeros((32, 1)))
child = os.fork()
total = sum(float(envs.step(np.zeros((32, 1)))[1].sum()) for _ in range(5))
# A line that is written at once cannot be split by the other's: print may write its end apart.
os.write(1, f"{total!r}\\n".encode())
if not child:
    os._exit(0)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_has_threads_of_its_own():
    run = subprocess.run(
        [sys.executable, "-c", FORK], capture_output=True, text=True, check=True, timeout=120
    )
    first, second = run.stdout.split()
    assert first == second
