"""A process that a controller lives in for a whole trial: one call after the other, each limited.

A pool has pieces of work that know nothing of each other; a controller keeps its state from one
control step to the next, and steps are short, so it has a process and a pipe of its own.
"""

import multiprocessing
import pickle
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, wait

from benchmarks.executors.failures import ProcessDied, TookTooLong
from benchmarks.executors.lifetime import end_with_parent, interrupts_blocked
from benchmarks.executors.work import run_packed, unpacked

END_S = 5.0
"""How long a process may take to end when it is asked to, before it is killed (s)."""


class ControllerProcess:
    """A process that answers one call after the other."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,))
        with interrupts_blocked():
            self._process.start()
        # Else its death would not end the connection.
        theirs.close()

    def ask(self, work: Callable[[], object], what: str, limit_s: float) -> object:
        """Call a method in the process; return its result or raise its exception.

        Args:
            work: to be pickled.
            what: what the error calls it if it takes too long.
            limit_s: how long it may take (s).
        Raises:
            TookTooLong: it took longer.
            ProcessDied: the process ended before.
        """
        content = pickle.dumps(work)
        # A process that died since its last call is met below.
        with suppress(OSError):
            self._connection.send_bytes(content)
        # Of a controller that started a process, that one may hold the connection after its death.
        if not wait([self._connection, self._process.sentinel], limit_s):
            raise TookTooLong(what, limit_s)
        try:
            if not self._connection.poll():
                raise EOFError
            return unpacked(self._connection.recv_bytes())
        except (EOFError, OSError):
            self._process.join(END_S)
            raise ProcessDied(self._process.exitcode) from None

    def end(self) -> None:
        """End the process, whatever it is at."""
        self._connection.close()
        for stop in (self._process.terminate, self._process.kill):
            if self._process.is_alive():
                stop()
                self._process.join(END_S)


def _serve(connection: Connection) -> None:
    """Answer calls until nobody is there to ask."""
    end_with_parent()
    with suppress(EOFError, OSError):
        while True:
            connection.send_bytes(run_packed(connection.recv_bytes()))
