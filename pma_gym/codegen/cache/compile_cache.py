"""Cache of compiled code: its folder and its entries.

The folder is private to the user, because whoever can write to it decides what runs. A folder that
others own or can write to is not used, and every entry has a signature by a key of this user. A
damaged entry, or one without a valid signature, is compiled again and never run.
"""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from pma_gym.codegen.cache.trust import (
    SIGNATURE_BYTES,
    UntrustedError,
    is_signed,
    private_folder,
    read_trusted,
    signature,
    user_key,
)
from pma_gym.files import home_folder, replace_file, temporary_folder

_MAGIC = b"pma_gym kernels 2\n"

WRITES_NO_CODE = ("cli", "demo", "discovery", "envs", "sb3", "studies")
"""What of the package lies above all that writes code: an edit there leaves kernels as they are."""

_FIX = "set PMA_GYM_CACHE to a writable folder that only you may write, to keep them"


@dataclass(frozen=True)
class _Store:
    """A folder of compiled code that this user alone may write, and the key of its signatures."""

    folder: Path
    key: bytes = field(repr=False)


def _store() -> _Store | None:
    """The store that the environment variables name now; None if no folder can be used.

    $PMA_GYM_CACHE, else the user's cache folder. If that cannot be created or written, or others
    can write to it, this is in a temporary folder of the process, with one warning.
    """
    asked = os.environ.get("PMA_GYM_CACHE")
    if asked:
        return _opened(Path(os.path.expanduser(asked)).absolute())
    caches = os.environ.get("XDG_CACHE_HOME")
    if caches:
        return _opened(Path(caches).absolute() / "pma_gym")
    home = home_folder()
    return _opened(None if home is None else home.absolute() / ".cache" / "pma_gym")


@cache
def _opened(folder: Path | None) -> _Store | None:
    if folder is None:
        fault = "this user has no home folder to keep compiled plants in"
    else:
        try:
            return _open(folder)
        except UntrustedError as error:
            fault = f"compiled plants are not kept in {folder}: {error}"
        except OSError as error:
            fault = f"cannot write compiled plants to {folder} ({error})"
    store = _temporary()
    place = "in memory only" if store is None else "into a temporary folder for this process"
    warnings.warn(f"{fault}; compiling {place}; {_FIX}", stacklevel=2)
    return store


def _open(folder: Path) -> _Store:
    private_folder(folder, link=True)
    kernels = folder / "kernels"
    private_folder(kernels, link=False)
    # Only trying tells: a disk may be full or read-only.
    with tempfile.TemporaryFile(dir=kernels):
        return _Store(kernels, user_key(kernels))


def _temporary() -> _Store | None:
    try:
        return _open(temporary_folder())
    except OSError:
        return None


def digest(parts: Iterable[str]) -> str:
    """Name of an entry that depends on these texts."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@cache
def source_digest() -> str:
    """Hash of the source of all modules that generate compiled code."""
    package, total = Path(__file__).parents[2], hashlib.sha256()
    # All below the environments: what a kernel is written by reaches from laws to calibrations.
    for path in sorted(package.glob("**/*.py")):
        name = path.relative_to(package)
        if name.with_suffix("").parts[0] not in WRITES_NO_CODE:
            text = path.read_bytes()
            total.update(f"{name} {len(text)}\n".encode() + text)
    return total.hexdigest()


def load(name: str) -> bytes | None:
    """Load the entry with a name.

    Returns:
        Its content; None if there is no entry, or if it is damaged, not signed with this user's
        key, or written by another user.
    """
    store = _store()
    if store is None:
        return None
    try:
        content = read_trusted(_path(store, name))
    except UntrustedError as error:
        _say_once(store, str(error))
        return None
    except OSError:
        return None
    end = len(_MAGIC) + SIGNATURE_BYTES
    head, signed, body = content[: len(_MAGIC)], content[len(_MAGIC) : end], content[end:]
    return body if head == _MAGIC and is_signed(store.key, name, body, signed) else None


def keep(name: str, body: bytes) -> None:
    """Store an entry under a name, if there is space."""
    with suppress(OSError):
        try:
            _write(name, body)
        except FileNotFoundError:
            # Somebody emptied the cache while this process ran.
            _opened.cache_clear()
            _write(name, body)


def _write(name: str, body: bytes) -> None:
    store = _store()
    if store is not None:
        content = _MAGIC + signature(store.key, name, body) + body
        replace_file(_path(store, name), content, private=True)


_said: set[Path] = set()


def _say_once(store: _Store, fault: str) -> None:
    if store.folder not in _said:
        _said.add(store.folder)
        warnings.warn(f"{fault}; it is not run, but compiled anew", stacklevel=3)


def _path(store: _Store, name: str) -> Path:
    return store.folder / f"{name}.o"
