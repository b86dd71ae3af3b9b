"""Runs independent pieces of work on an executor; Ctrl-C leaves what is done.

A piece of work and its result travel between processes as bytes; where a process died or took too
long, an exception stands for the result.
"""

import pickle
import signal
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol


class ProcessDied(RuntimeError):
    """The process that did a piece of work ended in the midst of it.

    Attributes:
        exit_code: of the process; less than 0 for a signal; None if it is not known.
    """

    def __init__(self, exit_code: int | None, again: bool = False) -> None:
        # Both arguments, so that it survives being sent to another process.
        super().__init__(exit_code, again)
        self.exit_code, self.again = exit_code, again

    def __str__(self) -> str:
        died = "its process died, and again when it ran alone" if self.again else "its process died"
        return f"{died}: {_how(self.exit_code)}"


class TookTooLong(RuntimeError):
    """A piece of work, or a call inside it, passed its time limit; its process was ended."""

    def __init__(self, what: str, limit_s: float) -> None:
        # Both arguments, so that it survives being sent to another process.
        super().__init__(what, limit_s)
        self.what, self.limit_s = what, limit_s

    def __str__(self) -> str:
        return (
            f"{self.what} took over {self.limit_s:g} s and was ended; look for an endless loop "
            "or for what waits there"
        )


def _how(exit_code: int | None) -> str:
    """How a process ended, and what to look for."""
    if exit_code is None:
        return "exit code unknown; look for what ends or hides a process in what it calls"
    if exit_code >= 0:
        return f"exit code {exit_code}; look for os._exit in what it calls"
    known = {signal.value: signal.name for signal in signal.Signals}
    name = known.get(-exit_code, "a signal without a name")
    fix = (
        "mostly for want of memory; look at how much it takes"
        if name == "SIGKILL"
        else "look for a crash in the compiled code that it calls"
    )
    return f"exit code {exit_code}, killed by {name}; {fix}"


Work = Callable[[], object]
"""A piece of work; pickled to be run in another process."""


def run_packed(work: bytes) -> bytes:
    """Run a pickled piece of work.

    Returns:
        What it returned, or the exception that it raised, pickled; an exception that cannot be
        pickled becomes a `RuntimeError` with its words.
    """
    try:
        call: Work = pickle.loads(work)
        return pickle.dumps(call())
    except BaseException as error:
        error.add_note(f"In the process that ran it:\n{traceback.format_exc()}")
        return _packed(error)


def unpacked(content: bytes) -> object:
    """Unpack what a piece of work returned, or the exception that it raised."""
    try:
        return pickle.loads(content)
    except Exception as error:
        return RuntimeError(f"its result cannot be read back: {type(error).__name__}: {error}")


def _packed(error: BaseException) -> bytes:
    try:
        content = pickle.dumps(error)
        pickle.loads(content)
    except Exception:
        return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return content


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
    """

    jobs: int

    def run(self, works: Sequence[Work], on_done: OnDone, untrusted: bool) -> None:
        """Run pieces of work, see `run_all`.

        Raises:
            KeyboardInterrupt: after the pieces in progress were ended.
        """
        ...


class ThisProcess:
    """Runs one piece after another in this process; one that ends its process ends this one.

    Nothing is packed: what cannot be pickled runs too, and Ctrl-C is no result.
    """

    jobs = 1

    def run(self, works: Sequence[Work], on_done: OnDone, untrusted: bool = False) -> None:
        """See `Executor`."""
        for index, work in enumerate(works):
            try:
                result = work()
            except (Exception, SystemExit) as error:
                result = error
            on_done(index, result)


class OtherProcesses:
    """Runs pieces in other processes: a piece that ends its process leaves this process alone."""

    def run_packed(self, works: Mapping[int, bytes], on_end: OnEnd, alone: bool) -> None:
        """Run packed pieces of work (see `run_packed`).

        Args:
            works: the pieces by number.
            on_end: called in this process and thread as they end, in any order.
            alone: one at a time.
        """
        raise NotImplementedError

    def run(self, works: Sequence[Work], on_done: OnDone, untrusted: bool) -> None:
        """See `Executor`."""
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

        self.run_packed(packed, first, alone=False)
        # Alone it has all of the memory, if that was the reason.
        self.run_packed({index: packed[index] for index in sorted(died)}, second, alone=True)


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
        executor.run(works, on_done, untrusted)
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
