"""Runs independent pieces of work on an executor; Ctrl-C leaves what is done."""

import pickle
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from benchmarks.executors.failures import ProcessDied, TookTooLong
from benchmarks.executors.work import Work, run_packed, unpacked

OnDone = Callable[[int, object], None]
"""Called with a piece's number, and what it returned or the exception that it raised."""

OnEnd = Callable[[int, "bytes | ProcessDied | TookTooLong"], None]
"""Called with a piece's number, and its packed result or why its process has none."""


class ExecutorMissing(RuntimeError):
    """An executor whose library is not installed; the message says how to install it."""


class Executor(Protocol):
    """Runs pieces of work.

    Attributes:
        jobs: how many at a time.
        isolates: whether a piece that ends its process leaves this process alone.
    """

    jobs: int
    isolates: bool

    def run(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool) -> None:
        """Run packed pieces of work (see `work.run_packed`).

        Args:
            works: the pieces by number.
            on_end: called in this process and thread as they end, in any order.
            alone: one at a time.
        Raises:
            KeyboardInterrupt: after the pieces in progress were ended.
        """
        ...


class ThisProcess:
    """Runs one piece after another in this process."""

    jobs, isolates = 1, False

    def run(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool = True) -> None:
        """See `Executor`; a piece that ends its process ends this one."""
        for index, work in works.items():
            on_end(index, run_packed(work))


def run_all(
    works: Sequence[Work], executor: Executor, on_done: OnDone, untrusted: bool = False
) -> bool:
    """Run every piece of work.

    A piece whose process dies is run once more, alone, after the others; if that process dies too,
    `ProcessDied` is its result. `TookTooLong` is the result of a piece that passed the executor's
    time limit. The other pieces are not affected. The executor has no influence on any bit of a
    result.

    Args:
        works: what to run; no piece may depend on another.
        executor: where.
        on_done: called in this process as results come, in any order.
        untrusted: a piece whose process died is not run again.
    Returns:
        Whether all of it was run: Ctrl-C ends the run at once, with the pieces in progress.
    """
    try:
        if executor.isolates:
            _run_elsewhere(works, executor, on_done, untrusted)
        else:
            _run_here(works, on_done)
    except KeyboardInterrupt:
        return False
    return True


def run_or_raise(
    works: Sequence[Work], executor: Executor, on_done: Callable[[int, Any], None]
) -> None:
    """Run pieces of work as `run_all` does, and raise if one fails.

    Raises:
        Exception: what the first piece that failed raised; the others are ended.
        KeyboardInterrupt: Ctrl-C ended the run.
    """

    def keep(index: int, result: object) -> None:
        if isinstance(result, BaseException):
            raise result
        on_done(index, result)

    if not run_all(works, executor, keep):
        raise KeyboardInterrupt


def _run_here(works: Sequence[Work], on_done: OnDone) -> None:
    """Without packing: what cannot be pickled runs too, and Ctrl-C is no result."""
    for index, work in enumerate(works):
        try:
            result = work()
        except (Exception, SystemExit) as error:
            result = error
        on_done(index, result)


def _run_elsewhere(
    works: Sequence[Work], executor: Executor, on_done: OnDone, untrusted: bool
) -> None:
    packed: dict[int, bytes] = {}
    for index, work in enumerate(works):
        try:
            packed[index] = pickle.dumps(work)
        except Exception as error:
            on_done(index, error)
    died: list[int] = []

    def first(index: int, end: bytes | ProcessDied | TookTooLong) -> None:
        if isinstance(end, ProcessDied) and not untrusted:
            died.append(index)
        else:
            on_done(index, unpacked(end) if isinstance(end, bytes) else end)

    def second(index: int, end: bytes | ProcessDied | TookTooLong) -> None:
        if isinstance(end, ProcessDied):
            end = ProcessDied(end.exit_code, again=True)
        on_done(index, unpacked(end) if isinstance(end, bytes) else end)

    executor.run(packed, first, alone=False)
    # Alone it has all of the memory, if that was the reason.
    executor.run({index: packed[index] for index in sorted(died)}, second, alone=True)
