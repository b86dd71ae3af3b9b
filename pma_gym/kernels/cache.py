"""Where compiled code is kept, and under which name.

The folder is the user's own, as a compiler's output is: whoever may write there decides what runs.
What is kept carries a hash of itself, so that a damaged file is compiled anew instead of run.
"""

import atexit
import hashlib
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path

from pma_gym.files import replace_file

_MAGIC = b"pma_gym kernels 1\n"


def cache_directory() -> Path:
    """Folder of compiled plants: $PMA_GYM_CACHE, else the user's cache folder.

    Falls back to a temporary folder, and says so once, where that cannot be written.
    """
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return _writable(Path(os.environ.get("PMA_GYM_CACHE") or Path(home) / "pma_gym"))


@cache
def _writable(wanted: Path) -> Path:
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        warnings.warn(
            f"cannot write compiled plants to {wanted} ({error}); compiling into a temporary "
            "folder for this process; set PMA_GYM_CACHE to a writable folder to keep them",
            stacklevel=2,
        )
    folder = Path(tempfile.mkdtemp(prefix="pma_gym_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def digest(parts: Iterable[str]) -> str:
    """A name for what is made from these texts."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@cache
def source_digest() -> str:
    """A hash of the texts of all modules that compiled code is written by."""
    package, total = Path(__file__).parent.parent, hashlib.sha256()
    # All of them: what a kernel is written by reaches from the laws to tasks and calibrations.
    for path in sorted(package.glob("**/*.py")):
        text = path.read_bytes()
        total.update(f"{path.relative_to(package)} {len(text)}\n".encode() + text)
    return total.hexdigest()


def load(name: str) -> bytes | None:
    """What is kept under a name; None if there is nothing, or if it is damaged."""
    try:
        content = _path(name).read_bytes()
    except OSError:
        return None
    head, body = content[: len(_MAGIC) + 32], content[len(_MAGIC) + 32 :]
    return body if head == _head(body) else None


def keep(name: str, body: bytes) -> None:
    """Keep something under a name, if there is room."""
    path = _path(name)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, _head(body) + body)


def _head(body: bytes) -> bytes:
    return _MAGIC + hashlib.sha256(body).digest()


def _path(name: str) -> Path:
    return cache_directory() / "kernels" / f"{name}.o"
