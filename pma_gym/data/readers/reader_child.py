"""The process that reads binary files, with limits of memory and time; its parent is another one.

It imports the library of a format when the first file of the format comes.

Tables between the process that reads binary files and the one that asked: JSON and raw doubles.

Nothing here can execute: a file that took over the reading process can at worst send wrong numbers.
"""

import importlib
import json
import logging
import mmap
import os
import signal
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import IO

import numpy as np

from pma_gym.data.readers.table import (
    Cells,
    FileFormat,
    NoHeaderError,
    Request,
    Table,
    UnreadableError,
    damaged,
)
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import PREFIX, LimitError, limit

_ERRORS = {kind.__name__: kind for kind in (TrialError, UnreadableError, NoHeaderError, LimitError)}


def request_fields(request: Request) -> dict[str, object]:
    """A request as JSON has it; of the lab's columns the names alone."""
    names = {
        theirs: entry.get("name", theirs) if isinstance(entry, Mapping) else entry
        for theirs, entry in request.columns.items()
    }
    return {"columns": names, "format": asdict(request.format)}


def request_of(fields: Mapping[str, Mapping[str, object]]) -> Request:
    """The request of its fields."""
    return Request(fields["columns"], FileFormat(**fields["format"]))  # type: ignore[arg-type]


def send_tables(stream: IO[bytes], tables: list[Table], **more: object) -> None:
    """Write tables: a line of JSON, then the numbers of all columns.

    Args:
        stream: where to.
        tables: cells are float64 arrays, or lists of numbers, texts, booleans and None.
        more: what else the line holds.
    """
    arrays: list[np.ndarray] = []

    def packed(cells: Cells) -> object:
        if not isinstance(cells, np.ndarray) and not all(type(cell) is float for cell in cells):
            return list(cells)
        arrays.append(np.asarray(cells, dtype=np.float64))
        return len(cells)

    said = [
        {
            **vars(table),
            "cells": [packed(cells) for cells in table.cells],
            "rows": packed(np.array(table.rows)),
        }
        for table in tables
    ]
    stream.write(json.dumps({"tables": said, **more}).encode() + b"\n")
    for array in arrays:
        stream.write(array.tobytes())
    stream.flush()


def send_error(stream: IO[bytes], error: Exception) -> None:
    """Write an error of this package."""
    kind = next(name for name in reversed(_ERRORS) if isinstance(error, _ERRORS[name]))
    stream.write(json.dumps({"error": kind, "message": str(error)}).encode() + b"\n")
    stream.flush()


def receive_tables(stream: IO[bytes]) -> tuple[list[Table], dict[str, object]]:
    """Read what `send_tables` or `send_error` wrote.

    Returns:
        The tables, and what else the line holds.
    Raises:
        TrialError, LimitError: that was sent.
        EOFError: the stream ends before.
    """
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    said = json.loads(line)
    if "error" in said:
        raise _ERRORS[said["error"]](said["message"])
    tables = []
    for fields in said.pop("tables"):
        fields["cells"] = [
            _numbers(stream, c) if isinstance(c, int) else c for c in fields["cells"]
        ]
        fields["rows"] = _numbers(stream, fields["rows"]).astype(int).tolist()
        fields["units"] = {int(index): unit for index, unit in fields["units"].items()}
        fields["remarks"] = tuple(fields["remarks"])
        tables.append(Table(**fields))
    return tables, said


def _numbers(stream: IO[bytes], count: int) -> np.ndarray:
    content = stream.read(8 * count)
    if len(content) < 8 * count:
        raise EOFError
    return np.frombuffer(content)


OUT_OF_MEMORY = 3
"""Status with which the process ends where memory is used up."""
_GRACE_S = 5
"""How much later than its parent the process ends itself: the parent may be gone."""


def serve() -> None:
    """Read file after file, until the standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    logging.disable()
    source, sink = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # What a library prints would stand amid the tables.
    os.dup2(2, 1)
    while line := source.readline():
        try:
            asked = json.loads(line)
            for name in [name for name in os.environ if name.startswith(PREFIX)]:
                del os.environ[name]
            os.environ.update(asked["limits"])
            content = source.read(asked["size"])
            limited = _limit_process(asked["size"])
            read = importlib.import_module(f"pma_gym.data.readers.{asked['kind']}").read
            try:
                tables = read(content, asked["file"], request_of(asked["request"]))
            except (MemoryError, TrialError, LimitError):
                raise
            # A library raises its own errors, OSError, ValueError, KeyError... for damaged files.
            except Exception as error:
                said = str(error).partition("\n")[0][:200] or type(error).__name__
                raise damaged(asked["file"], said) from None
            send_tables(sink, tables, limited=limited)
        except (TrialError, LimitError) as error:
            send_error(sink, error)
        except MemoryError:
            os._exit(OUT_OF_MEMORY)
        finally:
            _alarm(0)


def _limit_process(size: int) -> bool:
    """Limit memory and time for a file; whether the operating system limits memory."""
    _alarm(limit("reading_s") + _GRACE_S)
    try:
        import resource
    except ImportError:
        return False
    most = limit("reading_mib") * 2**20 + 2 * size
    # On Linux it counts all memory of a process that is its own and writable.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    with suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    try:
        mmap.mmap(-1, most + mmap.PAGESIZE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()
    except (OSError, MemoryError):
        return True
    return False


def _alarm(seconds: int) -> None:
    """End the process after some seconds, where the operating system can; 0: never."""
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
