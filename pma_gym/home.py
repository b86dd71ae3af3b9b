"""The user's home folder, and a replacement for libraries where there is none.

A container may run as a user without the variable HOME and without an entry in the list of users.
"""

import atexit
import os
from contextlib import suppress
from pathlib import Path

from pma_gym.partials import begin_temporary_folder, end_partial


def home_folder() -> Path | None:
    """Return the user's home folder, or None if there is none."""
    try:
        return Path.home()
    except RuntimeError:
        return None


def temporary_folder() -> Path:
    """Create a folder for this process only, removed at its end.

    Raises:
        OSError: there is no folder for temporary files.
    """
    folder = begin_temporary_folder("pma_gym")
    atexit.register(_remove, folder, os.getpid())
    return folder


def give_matplotlib_a_folder() -> None:
    """Set MPLCONFIGDIR without a home, else Matplotlib before 3.11 cannot be imported."""
    if "MPLCONFIGDIR" not in os.environ and home_folder() is None:
        with suppress(OSError):
            os.environ["MPLCONFIGDIR"] = str(temporary_folder())


def _remove(folder: Path, process: int) -> None:
    # A fork of the process that made it does not own it.
    if os.getpid() == process:
        with suppress(OSError):
            end_partial(folder)
