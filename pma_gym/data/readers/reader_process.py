"""Binary files are read in a process of their own: a damaged one ends that process and no other.

The libraries of HDF5, Parquet and others take gigabytes, minutes or the whole process where a file
of kilobytes is damaged or made to harm. One process is started at the first binary file and reads
the next ones too; after its death the next file starts another.
"""

import atexit
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from pma_gym.data.readers.reader_child import OUT_OF_MEMORY, receive_tables, request_fields
from pma_gym.data.readers.table import Request, Table, damaged
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import PREFIX, LimitError, limit

_START = (
    "import sys, types; package = sys.modules['pma_gym'] = types.ModuleType('pma_gym'); "
    "package.__path__ = sys.argv[1:]; import pma_gym.data.readers.reader_child as c; c.serve()"
)
"""Starts the process without what `pma_gym/__init__.py` imports, which takes half a second."""
_NO_LIMIT = (
    "this operating system sets a process no limit of memory: a damaged file may take all there is"
)


class _DeathError(Exception):
    """The process died; the message says how.

    Attributes:
        by_time: whether its parent ended it.
    """

    def __init__(self, status: int, by_time: bool) -> None:
        self.by_time = by_time
        if by_time:
            said = f"it takes over {limit('reading_s')} s; {PREFIX}READING_S sets more"
        elif status == OUT_OF_MEMORY:
            said = (
                f"it takes over {limit('reading_mib')} MiB of memory; {PREFIX}READING_MIB sets more"
            )
        else:
            name = signal.Signals(-status).name if status < 0 else f"status {status}"
            said = f"the library that reads it ended with {name}"
        super().__init__(said)


class _ReaderProcess:
    """The process, and the pipes to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._said = False

    def read(self, asked: Mapping[str, object], content: bytes) -> list[Table]:
        """The tables in a file."""
        with self._lock:
            while True:
                reused = self._process is not None
                try:
                    return self._ask(asked, content)
                except _DeathError as death:
                    # An earlier file may have left its damage in a process that went on.
                    if not reused or death.by_time:
                        raise damaged(str(asked["file"]), str(death)) from None

    def _ask(self, asked: Mapping[str, object], content: bytes) -> list[Table]:
        """Ask once.

        Raises:
            _DeathError: the process died.
        """
        process = self._process = self._process or _start()
        assert process.stdin and process.stdout
        seconds, began = limit("reading_s"), time.monotonic()
        timer = threading.Timer(seconds, process.kill)
        timer.start()
        try:
            process.stdin.write(json.dumps(asked, default=str).encode() + b"\n")
            process.stdin.write(content)
            process.stdin.flush()
            tables, said = receive_tables(process.stdout)
        except (TrialError, LimitError):
            raise
        except BaseException as error:
            by_time = time.monotonic() - began >= seconds
            with suppress(subprocess.TimeoutExpired):
                process.wait(1 if isinstance(error, EOFError | OSError) else 0)
            # Half of an answer may be in the pipe.
            self.end()
            if isinstance(error, EOFError | OSError):
                raise _DeathError(process.returncode, by_time) from None
            raise
        finally:
            timer.cancel()
        if not (said["limited"] or self._said) and tables:
            self._said = True
            tables[0] = replace(tables[0], remarks=(*tables[0].remarks, _NO_LIMIT))
        return tables

    def end(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is not None:
            with suppress(OSError), process:
                process.kill()


_READERS: dict[int, _ReaderProcess] = {}
"""By the process that asks: one that is forked from it has pipes of its own."""


def binary_reader(kind: str) -> Callable[[bytes, str, Request], list[Table]]:
    """The reader of a binary format.

    Args:
        kind: the module beside this one whose `read` reads the format.
    Returns:
        Takes bytes, the file's name and a request; gives tables. It raises a TrialError or a
        LimitError, an UnreadableError among them where the process dies of the file.
    """

    def read(content: bytes, file: str, request: Request) -> list[Table]:
        asked = {
            "kind": kind,
            "file": file,
            "size": len(content),
            "request": request_fields(request),
            "limits": {name: text for name, text in os.environ.items() if name.startswith(PREFIX)},
        }
        return _READERS.setdefault(os.getpid(), _ReaderProcess()).read(asked, content)

    return read


def _start() -> subprocess.Popen[bytes]:
    """A new process that reads. -P: it imports nothing from the folder where the command runs."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", _START, str(Path(__file__).parents[2])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"},
    )


@atexit.register
def _end() -> None:
    if os.getpid() in _READERS:
        _READERS[os.getpid()].end()
