"""One piece of work in another process, while this one does something else."""

import pickle
from collections.abc import Callable
from types import TracebackType
from typing import Generic, TypeVar, cast

from benchmarks.runner.worker import LOOK_S, ProcessDied, Worker, deaf_to_interrupt

Result = TypeVar("Result")


class Background(Generic[Result]):
    """Begins a piece of work at once; `result` waits for it.

    Where no process can be started, as in a program that does not guard its main module, the work
    is done here when its result is asked for.

    Args:
        work: to be pickled.
    """

    def __init__(self, work: Callable[[], Result]) -> None:
        self._work = work
        with deaf_to_interrupt():
            self._worker = Worker()
        self._worker.give(pickle.dumps(work))

    def result(self) -> Result:
        """What the work returned.

        Raises:
            Exception: whatever it raised.
        """
        try:
            while not Worker.wait([self._worker], LOOK_S):
                pass
            found = self._worker.result()
        except ProcessDied:
            return self._work()
        finally:
            self.end()
        if isinstance(found, BaseException):
            raise found
        return cast(Result, found)

    def end(self) -> None:
        """End the process, whatever it is at."""
        self._worker.end()

    def __enter__(self) -> "Background[Result]":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()
