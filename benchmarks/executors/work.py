"""A piece of work as bytes, and its result as bytes: what travels between processes."""

import pickle
import traceback
from collections.abc import Callable

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
