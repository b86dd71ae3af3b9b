"""A process that does one piece of work after another, so that its death is told from its work."""

import ctypes
import multiprocessing
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.sharedctypes import RawValue

LOOK_S = 0.1
"""How often to look whether a piece of work passed its limit (s)."""

LAST_WORDS_S = 5.0
"""How long a process may take to end when it is told to (s)."""


class ProcessDied(RuntimeError):
    """The process that did a piece of work ended in the midst of it.

    Attributes:
        exit_code: of the process; less than 0 for a signal; None if it is not known.
    """

    def __init__(self, exit_code: int | None, again: bool = False) -> None:
        self.exit_code = exit_code
        died = "its process died, and again when it ran alone" if again else "its process died"
        super().__init__(f"{died}: {_how(exit_code)}")


class TookTooLong(RuntimeError):
    """A call inside a piece of work passed its limit, and its process was ended."""

    def __init__(self, what: str, limit_s: float) -> None:
        # Both arguments, so that it survives being sent to another process.
        super().__init__(what, limit_s)
        self.what, self.limit_s = what, limit_s

    def __str__(self) -> str:
        return (
            f"{self.what} took over {self.limit_s:g} s and was ended; look for an endless loop "
            "or for what waits there"
        )


class _Limit(ctypes.Structure):
    """What a worker is at, in memory that its maker reads too.

    Attributes:
        due: when it must be done, by the clock of the machine (s); 0 if it has all the time.
        limit_s: how long that was (s).
        what: its words.
    """

    _fields_ = (
        ("due", ctypes.c_double),
        ("limit_s", ctypes.c_double),
        ("what", ctypes.c_char * 64),
    )


_mine: "_Limit | None" = None
"""This process's limit, if it is a worker."""


def begin_limited(what: str, limit_s: float) -> None:
    """From now on the process that made this worker ends it, unless `end_limited` comes in time.

    Works for what no signal or thread of this process could end, such as a loop in compiled code.
    Nothing happens in a process that is no worker.

    Args:
        what: how errors call what is limited.
        limit_s: how long it may take (s).
    """
    if _mine is not None:
        _mine.what, _mine.limit_s = what.encode()[:63], limit_s
        _mine.due = time.monotonic() + limit_s


def end_limited() -> None:
    """What was limited is done."""
    if _mine is not None:
        _mine.due = 0.0


class Worker:
    """A process of its own, deaf to Ctrl-C: the process that made it ends it."""

    def __init__(self) -> None:
        # Spawned, not forked: the progress display has a thread, and kernels may have some.
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._limit: _Limit = RawValue(_Limit)
        self._process = context.Process(target=_serve, args=(theirs, self._limit))
        self._process.start()
        # Else its death would not end the connection.
        theirs.close()

    def give(self, work: bytes) -> None:
        """Hand over a pickled piece of work; one at a time."""
        # A process that died since its last work is met by `result`.
        with suppress(OSError):
            self._connection.send_bytes(work)

    def result(self) -> object:
        """What the piece of work returned, or the exception that it raised; after `wait`.

        Raises:
            ProcessDied: the process ended before.
        """
        try:
            if not self._connection.poll():
                raise EOFError
            content = self._connection.recv_bytes()
        except (EOFError, OSError):
            self._process.join(LAST_WORDS_S)
            raise ProcessDied(self._process.exitcode) from None
        try:
            return pickle.loads(content)
        except Exception as error:
            return RuntimeError(f"its result cannot be read back: {type(error).__name__}: {error}")

    def ask(self, work: bytes) -> object:
        """Hand over a pickled piece of work and wait for its result.

        Raises:
            TookTooLong: it passed a limit of its own.
            ProcessDied: the process ended before.
        """
        self.give(work)
        # A process that the dead one left behind may still hold the connection.
        while not self._connection.poll(LOOK_S) and self._process.is_alive():
            late = self.overdue()
            if late is not None:
                raise late
        return self.result()

    def overdue(self) -> TookTooLong | None:
        """What it is at too long, or None."""
        due = self._limit.due
        if due == 0.0 or time.monotonic() < due:
            return None
        return TookTooLong(self._limit.what.decode(errors="replace"), self._limit.limit_s)

    def dismiss(self) -> None:
        """Let the process end by itself: there is no more work."""
        self._connection.close()

    def end(self) -> None:
        """End the process: at once, unless it was dismissed."""
        if self._connection.closed:
            self._process.join(LAST_WORDS_S)
        self._connection.close()
        for stop in (self._process.terminate, self._process.kill):
            if self._process.is_alive():
                stop()
                self._process.join(LAST_WORDS_S)

    @staticmethod
    def wait(workers: Iterable["Worker"], most_s: float) -> list["Worker"]:
        """Those of some workers that are done or have died; waits for one, but not for ever.

        Args:
            workers: some workers.
            most_s: how long to wait (s).
        """
        places: dict[object, Worker] = {}
        for worker in workers:
            # A process that the dead one left behind may still hold the connection.
            places[worker._connection] = places[worker._process.sentinel] = worker
        ready = wait(list(places), most_s)  # type: ignore[arg-type]
        return list(dict.fromkeys(places[place] for place in ready))


@contextmanager
def deaf_to_interrupt() -> Iterator[None]:
    """Ctrl-C does nothing inside, and processes started inside inherit that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)


def _serve(connection: Connection, limit: _Limit) -> None:
    """Do what comes until nobody is there to ask for more."""
    global _mine
    _mine = limit
    with suppress(EOFError, OSError):
        while True:
            connection.send_bytes(_done(connection.recv_bytes()))


def _done(work: bytes) -> bytes:
    """The pickled result of a pickled piece of work."""
    try:
        call: Callable[[], object] = pickle.loads(work)
        return pickle.dumps(call())
    except BaseException as error:
        error.add_note(f"In the process that ran it:\n{traceback.format_exc()}")
        return _packed(error)


def _packed(error: BaseException) -> bytes:
    """A pickled exception; one that does not survive it becomes its words."""
    try:
        content = pickle.dumps(error)
        pickle.loads(content)
    except Exception:
        return pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
    return content


def _how(exit_code: int | None) -> str:
    """How a process ended, and what to look for."""
    if exit_code is None:
        return "exit code unknown; look for what ends or hides a process in what it calls"
    if exit_code >= 0:
        return f"exit code {exit_code}; look for os._exit in what it calls"
    known = {signal.value: signal.name for signal in signal.Signals}
    name = known.get(-exit_code, "a signal without a name")
    mend = (
        "mostly for want of memory; look at how much it takes"
        if name == "SIGKILL"
        else "look for a crash in the compiled code that it calls"
    )
    return f"exit code {exit_code}, killed by {name}; {mend}"
