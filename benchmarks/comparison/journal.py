"""The journal of a run: one line a case, appended whole, so that a killed run loses nothing."""

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from benchmarks.comparison.case import Row
from benchmarks.suite import SuiteError
from pma_gym.files import replace_file

JOURNAL = "journal.jsonl"

SYNC_S = 2.0
"""How much of the work a crash of the machine may cost (s); a killed process costs none."""


class Journal:
    """Appends rows to a file, each by one write.

    Several processes may append to one file: the system puts every write at its end. A line that a
    crash tore is closed before the next one, and `read_rows` passes over it.

    Args:
        path: the file; made with its folder if it is not there.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = _opened(path)
        size = os.fstat(self._file).st_size
        if size and os.pread(self._file, 1, size - 1) != b"\n":
            os.write(self._file, b"\n")
        self._synced = time.monotonic()

    def append(self, row: Row) -> None:
        """Write a row; it is there even if this process is killed right after.

        Raises:
            OSError: it could not be written whole, as on a full disk.
        """
        line = (json.dumps(row, allow_nan=False) + "\n").encode()
        written = os.write(self._file, line)
        if written != len(line):
            raise OSError(f"only {written} of {len(line)} bytes of a row could be written")
        if time.monotonic() - self._synced > SYNC_S:
            os.fsync(self._file)
            self._synced = time.monotonic()

    def close(self) -> None:
        """Bring everything to the disk."""
        os.fsync(self._file)
        os.close(self._file)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _opened(path: Path) -> int:
    """The file, locked against being rewritten while it is appended to."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
        _lock(file, exclusive=False)
        # Another process may have put a rewritten journal in its place meanwhile.
        if path.exists() and os.path.samestat(os.fstat(file), path.stat()):
            return file
        os.close(file)


def _lock(file: int, exclusive: bool) -> None:
    """Lock a file until it is closed: appending processes share it, a rewriting one has it alone.

    Raises:
        BlockingIOError: wanted alone, and others append.
    """
    try:
        import fcntl
    except ImportError:  # Windows refuses to replace an open file.
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB if exclusive else fcntl.LOCK_SH)
    except BlockingIOError:
        raise
    except OSError:
        # Some network file systems have no locks.
        return


@dataclass
class Lines:
    """Lines of a journal that is rewritten, each with its end.

    Attributes:
        lines: as they were read; whoever rewrites puts others in their place.
    """

    lines: list[bytes]


@contextmanager
def rewriting(path: Path) -> Iterator[Lines]:
    """The lines of a journal, to be changed inside; the file is then replaced as a whole.

    Raises:
        SuiteError: a run is appending to it.
    """
    file = os.open(path, os.O_RDONLY)
    try:
        try:
            _lock(file, exclusive=True)
        except BlockingIOError:
            raise SuiteError(
                f"a run is writing to {path}; wait until it is done, or end it, and try again"
            ) from None
        lines = Lines(path.read_bytes().splitlines(keepends=True))
        yield lines
        replace_file(path, b"".join(lines.lines))
    finally:
        os.close(file)


def read_rows(path: Path) -> Iterator[Row]:
    """The rows of a journal, in the order in which they came; none if there is no file.

    What is no whole row, as a line that a crash tore, is passed over: its case counts as not run.
    """
    if not path.is_file():
        return
    with path.open("rb") as lines:
        for line in lines:
            try:
                row = json.loads(line)
            except ValueError:
                continue
            if isinstance(row, dict):
                yield row
