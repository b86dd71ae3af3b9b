"""The user's home folder, where there is one, and what libraries need where there is none.

A container may run as a user without the variable HOME and without an entry in the list of users.
"""

import atexit
import os
from contextlib import suppress
from pathlib import Path

from pma_gym.partials import begin_temporary_folder, end_partial


def home_folder() -> Path | None:
    """The user's home folder; None if this user has none."""
    try:
        return Path.home()
    except RuntimeError:
        return None


def temporary_folder() -> Path:
    """A new folder for this process alone, removed at its end.

    Raises:
        OSError: there is no folder for temporary files.
    """
    folder = begin_temporary_folder("pma_gym")
    atexit.register(_remove, folder, os.getpid())
    return folder


def give_matplotlib_a_folder() -> None:
    """Without a home, Matplotlib before 3.11 cannot be imported unless MPLCONFIGDIR is set."""
    if "MPLCONFIGDIR" not in os.environ and home_folder() is None:
        with suppress(OSError):
            os.environ["MPLCONFIGDIR"] = str(temporary_folder())


def _remove(folder: Path, process: int) -> None:
    # A fork of the process that made it does not own it.
    if os.getpid() == process:
        with suppress(OSError):
            end_partial(folder)
