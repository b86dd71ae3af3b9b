"""Names of partially written files, and removal of those that killed processes left.

A name carries the machine and the process that writes it, so that another process can tell a file
in progress from a leftover.
"""

import hashlib
import os
import re
import secrets
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

_FORM = re.compile(
    r"\..+\.(?:(?P<machine>[0-9a-f]{8})-(?P<process>[0-9]+)-)?[0-9a-f]{8}\.partial", re.DOTALL
)
"""Hidden, and of whoever writes it; earlier versions wrote no machine and no process."""

_DAY_S = 86400.0
"""Age beyond which a partial file is a leftover, whoever wrote it: no write takes a day."""

_NAME_CHARACTERS = 40
"""Of the final name, in the partial one: file systems allow 255 bytes in all."""

_in_progress: set[str] = set()
"""Names that this process writes under; the random part makes them unique in any folder."""


def begin_partial(path: Path) -> Path:
    """Return a new name beside a file, to write its next content under.

    Args:
        path: the file or folder that is to be replaced.
    Returns:
        A hidden name in the same folder, for only there is the final step a rename. Nothing is
        made. Give it to `end_partial` once it is renamed or removed.
    """
    clean_folder(path.parent)
    writer = f"{_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
    partial = path.with_name(f".{path.name[:_NAME_CHARACTERS]}.{writer}.partial")
    _in_progress.add(partial.name)
    return partial


def end_partial(partial: Path) -> None:
    """Remove the partial file of `begin_partial`, if it was not renamed."""
    try:
        remove(partial)
    finally:
        _in_progress.discard(partial.name)


def begin_temporary_folder(name: str) -> Path:
    """Create a temporary folder for this user only; remove it by `end_partial`.

    It is named as partial files are, so that the next one of any name removes what a killed process
    left.

    Args:
        name: what it is for.
    Raises:
        OSError: there is no place for temporary folders.
    """
    folder = begin_partial(Path(tempfile.gettempdir()) / name)
    folder.mkdir(mode=0o700)
    return folder


def clean_folder(folder: Path) -> None:
    """Remove partial files that killed processes left in a folder.

    A file of a live process stays. A file of another machine, or without a process in its name,
    stays for a day: whether its writer lives cannot be seen from here.

    Args:
        folder: where to look, not in its subfolders; none of this name is no error.
    """
    # Leftovers are no reason to fail what this process came for.
    with suppress(OSError):
        names = [entry.name for entry in os.scandir(folder) if entry.name.endswith(".partial")]
        for name in names:
            if is_leftover(folder / name):
                with suppress(OSError):
                    remove(folder / name)


def is_leftover(partial: Path) -> bool:
    """Return whether a partial file or folder has no writer; False for other names."""
    match = _FORM.fullmatch(partial.name)
    if match is None:
        return False
    if match["machine"] == _machine() and sys.platform != "win32":
        process = int(match["process"])
        # A process may have the number that a killed one had.
        mine = process == os.getpid()
        if partial.name not in _in_progress if mine else not _lives(process):
            return True
    try:
        return time.time() - partial.lstat().st_mtime > _DAY_S
    except OSError:
        return False


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with its contents; a missing one is no error."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _lives(process: int) -> bool:
    """Whether a process of this machine runs; one that ended and was not waited for does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
        return status.rpartition(")")[2].split()[0] not in "ZX"
    except (OSError, IndexError):
        return True


@cache
def _machine() -> str:
    """Where process numbers mean the same: the machine since its start, or the container."""
    parts = [os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")]
    for read in (
        lambda: Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"),
        lambda: os.readlink("/proc/self/ns/pid"),
    ):
        with suppress(OSError):
            parts.append(read())
    return hashlib.sha256("\0".join(parts).encode(errors="replace")).hexdigest()[:8]
