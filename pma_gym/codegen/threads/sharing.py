"""Threads that share a piece of work whose compiled parts let each other run."""

import threading
from collections.abc import Callable

from threadpoolctl import threadpool_limits


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
