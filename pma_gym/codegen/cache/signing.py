"""Signatures of compiled code: only code signed with this user's key is run.

The key is random, of this user, and lies beside the code with mode 0600. A signature covers the
name too, so that no entry can stand in for another.
"""

import hmac
import os
import warnings
from contextlib import suppress
from pathlib import Path

from pma_gym.codegen.cache.trust import UntrustedError, read_trusted
from pma_gym.partials import begin_partial, end_partial

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
