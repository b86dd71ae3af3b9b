"""Checks that compiled code is private to the user, and signs it.

Whoever can write machine code that this process loads decides what the process does. A folder or
file is therefore accepted only if the user of this process owns it and nobody else can write it. On
systems without such owners (Windows), the system protects the user's profile.
"""

import hmac
import os
import stat
import warnings
from contextlib import suppress
from pathlib import Path

from pma_gym.partials import begin_partial, end_partial

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


KEY_FILE = "key"
_KEY_BYTES = 32
SIGNATURE_BYTES = 32


def signature(key: bytes, name: str, body: bytes) -> bytes:
    """HMAC-SHA256 of an entry's name and content."""
    # The length first: where the name ends matters.
    start = f"{len(name)} {name}\n".encode()
    return hmac.digest(key, start + body, "sha256")


def is_signed(key: bytes, name: str, body: bytes, signed: bytes) -> bool:
    """Whether a signature is valid for an entry."""
    return hmac.compare_digest(signature(key, name, body), signed)


def user_key(folder: Path) -> bytes:
    """Return the key in a folder; create it if there is none, or none that is secret.

    Processes that create it at the same time get the same key.

    Args:
        folder: one that this user alone may write.
    Raises:
        OSError: it can be neither read nor made.
    """
    path = folder / KEY_FILE
    try:
        key = read_trusted(path, secret=True)
        if len(key) == _KEY_BYTES:
            return key
        fault = f"{path} is damaged"
    except FileNotFoundError:
        return _make(path)
    except UntrustedError as error:
        fault = str(error)
    except OSError as error:
        # Such as a link, which is not followed.
        fault = f"{path} cannot be read ({error.strerror})"
    warnings.warn(
        f"the key of the compiled code is not used: {fault}; a new one is made, and what the old "
        "one signed is compiled again",
        stacklevel=2,
    )
    path.unlink()
    return _make(path)


def _make(path: Path) -> bytes:
    partial = begin_partial(path)
    try:
        with os.fdopen(os.open(partial, _CREATE, 0o600), "wb") as file:
            file.write(os.urandom(_KEY_BYTES))
        _publish(partial, path)
    finally:
        end_partial(partial)
    key = read_trusted(path, secret=True)
    if len(key) != _KEY_BYTES:
        raise OSError(f"{path} is damaged")
    return key


def _publish(partial: Path, path: Path) -> None:
    """Give the file its name, unless another process was first."""
    with suppress(FileExistsError):
        try:
            os.link(partial, path)
        except FileExistsError:
            raise
        except (OSError, AttributeError):
            # Where files have one name only. On Windows this fails if the name is taken.
            os.rename(partial, path)


_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
