"""Threads that share a piece of work whose compiled parts let each other run."""

import threading
from collections.abc import Callable


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
