"""Processes on this machine, by pebble: time limits, and deaths that cost one piece each.

Lifetime of worker processes: they end with their parent, and survive Ctrl-C.
"""

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, TimeoutError, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection, get_context, parent_process
from typing import cast

from benchmarks.executors.executor import (
    ExecutorMissing,
    OnEnd,
    OtherProcesses,
    ProcessDied,
    TookTooLong,
    run_packed,
)

_PR_SET_PDEATHSIG = 1
"""Option of Linux's prctl(2): the signal that a process gets when its parent dies."""

_WATCH = "end with another process"

_ASK_S = 0.2
"""How often to ask whether a process is there, where the system does not tell (s)."""


def end_with_parent() -> None:
    """End this process when the one that started it is gone, whatever this one is at.

    On Linux the kernel sends SIGKILL. Elsewhere a thread watches a pipe that the parent holds open;
    compiled code that keeps Python's lock delays it.
    """
    parent = parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # It may have died before the kernel was asked.
        if os.getppid() != parent.pid:
            os._exit(1)
    elif not any(thread.name == _WATCH for thread in threading.enumerate()):
        threading.Thread(target=_watch, args=(parent.sentinel,), name=_WATCH, daemon=True).start()


def end_with(pid: int) -> None:
    """End this process soon after another one of this machine, which need not be its parent.

    Does nothing on Windows, where asking for a process sends it a signal.
    """
    if sys.platform != "win32" and not any(
        thread.name == _WATCH for thread in threading.enumerate()
    ):
        threading.Thread(target=_watch_process, args=(pid,), name=_WATCH, daemon=True).start()


def _watch_process(pid: int) -> None:
    """Without a parent's pipe: Linux has a file that becomes readable, others are asked."""
    try:
        if sys.platform == "linux":
            connection.wait([os.pidfd_open(pid)])
        else:
            while True:
                os.kill(pid, 0)
                time.sleep(_ASK_S)
    except OSError:
        pass
    os._exit(1)


def _watch(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Threads and processes that start inside never get Ctrl-C; whoever starts them ends them.

    The mask is inherited, also by a new interpreter before it runs its first line. Ctrl-C during
    the block arrives at its end. Windows has no masks.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


try:
    from pebble import ProcessExpired, ProcessPool
except ImportError:
    raise ExecutorMissing(
        "several processes need pebble, which is not installed; run: "
        "pip install -c constraints.txt -e '.[bench]', or run one process (--jobs 1)"
    ) from None


class LocalProcesses(OtherProcesses):
    """Runs pieces of work in processes of this machine.

    The processes end with this one, however it ends (`lifetime.end_with_parent`).

    Args:
        jobs: number of processes.
        limit_s: how long a piece may take before its process is ended (s); None: as long as it
            takes.
        what: what the error calls a piece that took longer.
    """

    def __init__(
        self, jobs: int, limit_s: float | None = None, what: str = "a piece of work"
    ) -> None:
        self.jobs, self._limit_s, self._what = jobs, limit_s, what

    def run_packed(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool) -> None:
        """See `OtherProcesses`."""
        if not works:
            return
        most = 1 if alone else min(self.jobs, len(works))
        # Spawned, not forked: the progress display has a thread, and kernels may have some.
        pool = ProcessPool(most, initializer=_begin, context=get_context("spawn"))
        try:
            with interrupts_blocked():
                waiting: dict[Future[bytes], int] = {
                    pool.schedule(run_packed, (work,), timeout=self._limit_s): index
                    for index, work in works.items()
                }
            while waiting:
                done, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in sorted(done, key=waiting.__getitem__):
                    on_end(waiting.pop(future), self._end(future))
        finally:
            with interrupts_blocked():
                pool.stop()
                pool.join()

    def _end(self, future: "Future[bytes]") -> bytes | ProcessDied | TookTooLong:
        try:
            return future.result()
        except TimeoutError:
            return TookTooLong(self._what, cast(float, self._limit_s))
        except ProcessExpired as error:
            return ProcessDied(error.exitcode)
        except (BrokenProcessPool, CancelledError):
            # A process that dies between two pieces takes the pool with it.
            return ProcessDied(None)


def _begin() -> None:
    """Before a process's first piece of work."""
    end_with_parent()
    leave = os._exit

    # The pool takes exit code 0 for an orderly end, and would wait for the piece's result for ever.
    def exit_with_a_code(status: int) -> None:
        leave(status or os.EX_SOFTWARE)

    os._exit = exit_with_a_code  # type: ignore[assignment]
