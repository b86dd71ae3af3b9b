"""The process that reads binary files, with limits of memory and time; its parent is another one.

It imports the library of a format when the first file of the format comes.
"""

import importlib
import json
import logging
import mmap
import os
import signal
import warnings
from contextlib import suppress

from pma_gym.data.readers.table import damaged
from pma_gym.data.readers.table_transfer import request_of, send_error, send_tables
from pma_gym.data.trial_columns import TrialError
from pma_gym.limits import PREFIX, LimitError, limit

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
