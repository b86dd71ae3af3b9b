"""The journal of a run: one JSON object a line and case, flushed: a killed run loses nothing.

Each row has the fingerprint of what it was computed with, see `fingerprint.key`.
"""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from benchmarks.files import say_damaged
from benchmarks.runner.case import Row
from benchmarks.runner.phase_score import PhaseScore
from benchmarks.suites.suite import SuiteError
from pma_gym.document_shape import Maybe, Real, Whole, check_shape
from pma_gym.documents import parse_json
from pma_gym.files import replace_file
from pma_gym.limits import limit

JOURNAL = "journal.jsonl"

_ROW = {
    "key?": Maybe(str),
    "suite": str,
    "version": Whole(),
    "controller": str,
    "station": Whole(),
    "task": str,
    "pressure_kpa": Real(),
    "repeat": Whole(),
    "seed": Whole(),
    "failure": str,
}
"""Shape of a case's row."""

_FIGURES = {
    "unit": str,
    "phases": {"*": {"rmse": Real(), "percent_of_range": Real(), "largest_error": Real()}},
    **{
        name: Real()
        for name in (
            "rmse",
            "start_rmse",
            "steady_rmse",
            "effort_v",
            "variation_v_per_s",
            "saturation_share",
            "violation",
            "act_us",
            "act_us_worst",
        )
    },
    "exercise?": {"*": Maybe(Real())},
    "lines?": {
        "*": {
            **{entry.name: Real() for entry in fields(PhaseScore)},
            "largest_error": Maybe(Real()),
        }
    },
    "times?": {"steps": Whole(), "step_seconds": Real(), "seconds": Real()},
}
"""Shape of the figures of a case that has some."""


class Journal:
    """Appends rows to a file, each flushed whole.

    Several processes may append to one file: the system puts every write at its end. A line that a
    crash tore is closed before the next one, and `case_rows` passes over it.

    Args:
        path: the file; made with its folder if it is not there.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = _opened(path)
        size = os.fstat(self._file).st_size
        if size and os.pread(self._file, 1, size - 1) != b"\n":
            os.write(self._file, b"\n")

    def append(self, row: Row) -> None:
        """Write a row; it is there even if this process is killed right after.

        Raises:
            OSError: it could not be written whole, as on a full disk.
        """
        line = json.dumps(row, allow_nan=False).encode() + b"\n"
        written = os.write(self._file, line)
        if written != len(line):
            raise OSError(f"only {written} of {len(line)} bytes of a row could be written")

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *error: object) -> None:
        os.close(self._file)


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


def rewrite(path: Path, stays: Callable[[bytes], bool]) -> int:
    """Keep only some lines of a journal, which is replaced as a whole; how many went.

    Raises:
        SuiteError: a run is appending to it.
    """
    file = os.open(path, os.O_RDONLY)
    try:
        _lock(file, exclusive=True)
        lines = path.read_bytes().splitlines(keepends=True)
        kept = [line for line in lines if stays(line)]
        replace_file(path, b"".join(kept))
    except BlockingIOError:
        raise SuiteError(
            f"a run is writing to {path}; wait until it is done, or end it, and try again"
        ) from None
    finally:
        os.close(file)
    return len(lines) - len(kept)


def case_rows(path: Path) -> Iterator[Row]:
    """The rows of a journal, in the order in which they came; none if there is no file.

    A line that is no whole row, as one that a crash tore, is passed over: its case counts as not
    run, and one line on standard error says so.
    """
    damaged: list[str] = []
    for number, line in enumerate(_lines(path), start=1):
        if not line.strip():
            continue
        try:
            row: Any = parse_json(line, "the row", own=True)
            check_shape(row, _ROW)
            if not row["failure"]:
                check_shape(row, _FIGURES)
        except ValueError as error:
            damaged.append(f"line {number}: {error}")
            continue
        yield row
    if damaged:
        more = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
        say_damaged(path, f"{damaged[0]}{more}", "those cases count as not run, the others stay")


def _lines(path: Path) -> Iterator[bytes]:
    """Lines of a file, none if it is not there; one that is too long comes in pieces."""
    if path.is_file():
        most = limit("document_kib") * 1024
        with path.open("rb") as file:
            yield from iter(lambda: file.readline(most), b"")
