"""Lifetime of worker processes: they end with their parent, and survive Ctrl-C."""

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import connection, parent_process

_PR_SET_PDEATHSIG = 1
"""Option of Linux's prctl(2): the signal that a process gets when its parent dies."""

_WATCH = "end with another process"

_ASK_S = 0.2
"""How often to ask whether a process is there, where the system does not tell (s)."""


def end_with_parent() -> None:
    """End this process when the one that started it is gone, whatever this one is at.

    On Linux the kernel sends SIGKILL. Elsewhere a thread watches a pipe that the parent holds open;
    compiled code that keeps Python's lock delays it.
    """
    parent = parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        # It may have died before the kernel was asked.
        if os.getppid() != parent.pid:
            os._exit(1)
    elif not any(thread.name == _WATCH for thread in threading.enumerate()):
        threading.Thread(target=_watch, args=(parent.sentinel,), name=_WATCH, daemon=True).start()


def end_with(pid: int) -> None:
    """End this process soon after another one of this machine, which need not be its parent.

    Does nothing on Windows, where asking for a process sends it a signal.
    """
    if sys.platform != "win32" and not any(
        thread.name == _WATCH for thread in threading.enumerate()
    ):
        threading.Thread(target=_watch_process, args=(pid,), name=_WATCH, daemon=True).start()


def _watch_process(pid: int) -> None:
    """Without a parent's pipe: Linux has a file that becomes readable, others are asked."""
    try:
        if sys.platform == "linux":
            connection.wait([os.pidfd_open(pid)])
        else:
            while True:
                os.kill(pid, 0)
                time.sleep(_ASK_S)
    except OSError:
        pass
    os._exit(1)


def _watch(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Threads and processes that start inside never get Ctrl-C; whoever starts them ends them.

    The mask is inherited, also by a new interpreter before it runs its first line. Ctrl-C during
    the block arrives at its end. Windows has no masks.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
