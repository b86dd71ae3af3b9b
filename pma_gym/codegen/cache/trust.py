"""Checks that folders and files of compiled code are private to the user.

Whoever can write machine code that this process loads decides what the process does. A folder or
file is therefore accepted only if the user of this process owns it and nobody else can write it. On
systems without such owners (Windows), the system protects the user's profile.
"""

import os
import stat
from pathlib import Path

_READ = (
    os.O_RDONLY
    | getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_CLOEXEC", 0)
    # A pipe in place of a file would make the reader wait for ever.
    | getattr(os, "O_NONBLOCK", 0)
    | getattr(os, "O_BINARY", 0)
)

_HAS_OWNERS = hasattr(os, "geteuid")

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_OTHERS_ANY = stat.S_IRWXG | stat.S_IRWXO


class UntrustedError(OSError):
    """A folder or file that another user may have written; the message says why and the fix."""


def private_folder(folder: Path, link: bool) -> None:
    """Create a private folder of this user, or check that an existing one is private.

    The folders above it do not matter: what another user puts in its place is not owned by this
    user, and every file is checked once more when it is open.

    Args:
        folder: its path; folders above it are made too.
        link: whether the path may be this user's own link to such a folder.
    Raises:
        UntrustedError: another user owns it or may write it.
        OSError: it cannot be made.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    try:
        # Whatever the umask: one that lets the group write would make it one of the group's.
        folder.mkdir(mode=0o700)
    except FileExistsError:
        if not folder.is_dir():
            raise
    own = folder.lstat()
    if stat.S_ISLNK(own.st_mode):
        if not link:
            raise UntrustedError(f"{folder} is a link; remove it")
        _check_owner(own, folder)
        own = folder.stat()
    _check_owner(own, folder)
    if _HAS_OWNERS and own.st_mode & _OTHERS_WRITE:
        raise UntrustedError(
            f"other users may write to {folder} (mode {stat.S_IMODE(own.st_mode):04o}); empty it "
            "and use 'chmod go-w' on it"
        )


def read_trusted(path: Path, secret: bool = False) -> bytes:
    """Read a file that only this user can have written.

    Args:
        path: the file; no link.
        secret: nobody else may have read it either.
    Raises:
        FileNotFoundError: there is none.
        UntrustedError: another user may have written it, or read it where it is a secret.
        OSError: it cannot be read.
    """
    with os.fdopen(os.open(path, _READ), "rb") as file:
        own = os.fstat(file.fileno())
        if not stat.S_ISREG(own.st_mode):
            raise UntrustedError(f"{path} is no ordinary file")
        if _HAS_OWNERS:
            _check_owner(own, path)
            if own.st_mode & (_OTHERS_ANY if secret else _OTHERS_WRITE):
                mode = f"mode {stat.S_IMODE(own.st_mode):04o}"
                may = "read or write" if secret else "write"
                raise UntrustedError(f"other users may {may} {path} ({mode})")
        return file.read()


def _check_owner(own: os.stat_result, path: Path) -> None:
    if _HAS_OWNERS and own.st_uid != os.geteuid():
        raise UntrustedError(
            f"{path} belongs to another user (uid {own.st_uid}, this process has {os.geteuid()})"
        )
