"""Processes on this machine, by pebble: time limits, and deaths that cost one piece each."""

import os
import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, TimeoutError, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Generic, TypeVar, cast

from benchmarks.executors.executor import (
    ExecutorMissing,
    OnEnd,
    ProcessDied,
    TookTooLong,
    run_packed,
    unpacked,
)
from benchmarks.executors.lifetime import end_with_parent, interrupts_blocked

try:
    from pebble import ProcessExpired, ProcessPool
except ImportError:
    raise ExecutorMissing(
        "several processes need pebble, which is not installed; run: "
        "pip install -c constraints.txt -e '.[bench]', or run one process (--jobs 1)"
    ) from None

Result = TypeVar("Result")


class LocalProcesses:
    """Runs pieces of work in processes of this machine.

    The processes end with this one, however it ends (`lifetime.end_with_parent`).

    Args:
        jobs: number of processes.
        limit_s: how long a piece may take before its process is ended (s); None: as long as it
            takes.
        what: what the error calls a piece that took longer.
    """

    isolates = True

    def __init__(
        self, jobs: int, limit_s: float | None = None, what: str = "a piece of work"
    ) -> None:
        self.jobs, self._limit_s, self._what = jobs, limit_s, what

    def run(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool) -> None:
        """See `Executor`."""
        if not works:
            return
        pool = _pool(1 if alone else min(self.jobs, len(works)))
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


class Background(Generic[Result]):
    """Begins a piece of work in another process at once; `result` waits for it.

    Where no process can be started, as in a program that does not guard its main module, the work
    is done here when its result is asked for.

    Args:
        work: to be pickled.
    """

    def __init__(self, work: Callable[[], Result]) -> None:
        self._work, self._pool = work, _pool(1)
        with interrupts_blocked():
            self._future = self._pool.schedule(run_packed, (pickle.dumps(work),))

    def result(self) -> Result:
        """Return the result of the work.

        Raises:
            Exception: whatever it raised.
        """
        try:
            result = unpacked(self._future.result())
        except (ProcessExpired, BrokenProcessPool):
            return self._work()
        finally:
            self.end()
        if isinstance(result, BaseException):
            raise result
        return cast(Result, result)

    def end(self) -> None:
        """End the process, whatever it is at."""
        with interrupts_blocked():
            self._pool.stop()
            self._pool.join()

    def __enter__(self) -> "Background[Result]":
        return self

    def __exit__(self, *error: object) -> None:
        self.end()


def _pool(processes: int) -> ProcessPool:
    # Spawned, not forked: the progress display has a thread, and kernels may have some.
    return ProcessPool(processes, initializer=_begin, context=get_context("spawn"))


def _begin() -> None:
    """Before a process's first piece of work."""
    end_with_parent()
    leave = os._exit

    # The pool takes exit code 0 for an orderly end, and would wait for the piece's result for ever.
    def exit_with_a_code(status: int) -> None:
        leave(status or os.EX_SOFTWARE)

    os._exit = exit_with_a_code  # type: ignore[assignment]
