"""Runs independent pieces of work on several processes; Ctrl-C leaves what is done."""

import pickle
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence

from benchmarks.runner.worker import LOOK_S, ProcessDied, Worker, deaf_to_interrupt

Work = Callable[[], object]
"""A piece of work; pickled to be run in another process."""

OnDone = Callable[[int, object], None]
"""Called with a piece's number, and what it returned or the exception that it raised."""


def run_all(works: Sequence[Work], jobs: int, on_done: OnDone, wary: bool = False) -> bool:
    """Run every piece of work, `jobs` at a time.

    A piece whose process dies is run once more, alone, after the others; if that process dies too,
    `ProcessDied` is its result. One that passes a limit of its own (`worker.begin_limited`) has its
    process ended; `TookTooLong` is its result. The others are not touched by it.

    Args:
        works: what to run; no piece may depend on another.
        jobs: number of processes; 1 runs in this one.
        on_done: called in this process as results come, in any order.
        wary: of works that are not trusted: none runs in this process, and none twice.
    Returns:
        Whether all of it was run: Ctrl-C ends the run at once, with the pieces in progress.
    """
    try:
        if jobs > 1 or wary:
            _run_in_processes(works, jobs, on_done, wary)
        else:
            _run_here(works, on_done)
    except KeyboardInterrupt:
        return False
    return True


def _run_here(works: Sequence[Work], on_done: OnDone) -> None:
    for index, work in enumerate(works):
        try:
            result = work()
        except (Exception, SystemExit) as error:
            result = error
        on_done(index, result)


def _run_in_processes(works: Sequence[Work], jobs: int, on_done: OnDone, once: bool) -> None:
    packed: dict[int, bytes] = {}
    for index, work in enumerate(works):
        try:
            packed[index] = pickle.dumps(work)
        except Exception as error:
            on_done(index, error)
    died = _attempt(packed, packed, jobs, on_done, last=once)
    # Alone it has all of the memory, if that was the reason.
    _attempt(packed, sorted(died), 1, on_done, last=True, again=True)


def _attempt(
    packed: Mapping[int, bytes],
    order: Iterable[int],
    jobs: int,
    on_done: OnDone,
    last: bool,
    again: bool = False,
) -> list[int]:
    """Run pieces of work, some at a time.

    Args:
        packed: the pieces.
        order: numbers of those to run.
        jobs: how many at a time.
        on_done: called as results come.
        last: a death is a result.
        again: it is not their first attempt.
    Returns:
        Those whose process died, if that is no result.
    """
    waiting, died = deque(order), list[int]()
    workers, idle, busy = list[Worker](), list[Worker](), dict[Worker, int]()
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                if not idle:
                    with deaf_to_interrupt():
                        workers.append(Worker())
                        idle.append(workers[-1])
                worker, index = idle.pop(), waiting.popleft()
                busy[worker] = index
                worker.give(packed[index])
            for worker in Worker.wait(busy, LOOK_S):
                index = busy.pop(worker)
                try:
                    result = worker.result()
                except ProcessDied as error:
                    if last:
                        on_done(index, ProcessDied(error.exit_code, again))
                    else:
                        died.append(index)
                else:
                    idle.append(worker)
                    on_done(index, result)
            for worker, late in [(w, w.overdue()) for w in busy]:
                if late is not None:
                    worker.end()
                    on_done(busy.pop(worker), late)
    finally:
        with deaf_to_interrupt():
            for worker in idle:
                worker.dismiss()
            for worker in workers:
                worker.end()
    return died
