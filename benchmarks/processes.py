"""Runs independent pieces of work on several processes; Ctrl-C leaves what is done."""

import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager

Work = Callable[[], object]
"""A piece of work; pickled to be run in another process."""

OnDone = Callable[[int, object], None]
"""Called with a piece's number, and what it returned or the exception that it raised."""


def run_all(works: Sequence[Work], jobs: int, on_done: OnDone) -> bool:
    """Run every piece of work, `jobs` at a time.

    Args:
        works: what to run; no piece may depend on another.
        jobs: number of processes; 1 runs in this one.
        on_done: called in this process as results come, in any order.
    Returns:
        Whether all of it was run: Ctrl-C ends the run after the pieces in progress.
    """
    try:
        (_run_here if jobs == 1 else _run_in_processes)(works, jobs, on_done)
    except KeyboardInterrupt:
        return False
    return True


def _run_here(works: Sequence[Work], jobs: int, on_done: OnDone) -> None:
    for index, work in enumerate(works):
        try:
            result = work()
        except (Exception, SystemExit) as error:
            result = error
        on_done(index, result)


def _run_in_processes(works: Sequence[Work], jobs: int, on_done: OnDone) -> None:
    # Spawned, not forked: the progress display has a thread, and numba may have some.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        with _deaf_to_interrupt():
            waiting = {pool.submit(work): index for index, work in enumerate(works)}
        try:
            while waiting:
                _collect(waiting, on_done)
        except KeyboardInterrupt:
            # Those in progress are let finish, for each takes a second or two.
            pool.shutdown(wait=True, cancel_futures=True)
            _collect(waiting, on_done)
            raise


def _collect(waiting: dict[Future[object], int], on_done: OnDone) -> None:
    """Wait for a piece at least, and hand on what is done."""
    done, _ = wait(waiting, return_when=FIRST_COMPLETED)
    for future in done:
        if not future.cancelled():
            # A process that died has an exception for each piece that it leaves undone.
            on_done(waiting[future], future.exception() or future.result())
        del waiting[future]


@contextmanager
def _deaf_to_interrupt() -> Iterator[None]:
    """Processes started inside inherit that Ctrl-C is not for them: this one ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
