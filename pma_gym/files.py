"""Atomic writing of files, and checks of output paths.

Recognition of file paths, and reasons why a file cannot be read.

The user's home folder, and a replacement for libraries where there is none.

A container may run as a user without the variable HOME and without an entry in the list of users.
"""

import atexit
import difflib
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from pma_gym.partials import begin_partial, begin_temporary_folder, end_partial


class OutputError(ValueError):
    """A file that cannot be written; the message names file, reason and fix."""


def check_output(path: Path) -> None:
    """Refuse an output file that cannot be written, before any computation.

    The one rule of all commands: the folder exists and lets files be made; the file is new, or an
    ordinary file that may be written. Nothing is made or changed.

    Args:
        path: the file.
    Raises:
        OutputError: names the file, what is in the way and the mend.
    """
    fault = _fault(Path(path))
    if fault:
        raise OutputError(f"cannot write {path}: {fault}")


def _fault(path: Path) -> str:
    """What keeps a file from being written and what to do about it; nothing if nothing does."""
    folder = path.parent
    if path.is_dir():
        return f"{path} is a folder; name a file in it"
    if not folder.is_dir():
        fault = f"{folder} is no folder" if folder.exists() else f"there is no folder {folder}"
        return f"{fault}; name a file in a folder that exists, or make the folder"
    if path.exists() and not path.is_file():
        return "it is no ordinary file; name another"
    if path.exists() and not os.access(path, os.W_OK):
        return "the file is write-protected; name another, or allow writing to it"
    try:
        # Only trying tells: a full disk or a read-only one lets permissions look well.
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return (
            f"no file can be made in the folder {folder} ({error.strerror}); name a file in "
            "another, or allow writing to this one"
        )


def replace_file(path: Path, content: bytes, private: bool = False) -> None:
    """Replace a file atomically: a reader sees the old or the new content, never a part.

    Args:
        path: the file; its folder exists.
        content: all of it.
        private: only its owner may read and write it (mode 0600), whatever the umask.
    """
    replace_files({path: content}, private)


def replace_files(contents: Mapping[Path, bytes], private: bool = False) -> None:
    """Replace several files together; if the disk fails or is full, all old ones stay.

    Only between the final steps, which write nothing, could new and old ones stand side by side.
    What killed processes left half-written in these folders is removed.

    Args:
        contents: all of each file, the last one to be replaced last; their folders exist.
        private: only their owner may read and write them (mode 0600), whatever the umask.
    """
    partials = {begin_partial(path): path for path in contents}
    try:
        for partial, path in partials.items():
            if private:
                os.close(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
            partial.write_bytes(contents[path])
        for partial, path in partials.items():
            os.replace(partial, path)
    finally:
        for partial in partials:
            end_partial(partial)


def as_path(path: str | os.PathLike[str], error: type[ValueError] = ValueError) -> Path:
    """Return a path; refuse an empty text, which `Path` takes for the current folder.

    Raises:
        ValueError: of the type of `error`.
    """
    if not os.fspath(path).strip():
        raise error("the path is empty; name a file or a folder ('.' is the current one)")
    return Path(path)


def is_path(source: str | Path) -> bool:
    """Return whether text is a path (a separator, or ending .toml), not a shipped name.

    >>> [is_path(text) for text in ("station", "station.toml", "mine/station")]
    [False, True, True]
    """
    text = str(source)
    separators = {os.sep, os.altsep or os.sep, "/"}
    return text.endswith(".toml") or any(each in text for each in separators)


def missing_file(path: Path, ending: str = ".toml") -> str:
    """Return why a path is not a readable file with one ending, and the fix; empty if it is.

    Args:
        path: as it was given.
        ending: how the file's name must end.
    """
    if path.is_dir():
        return f"{path} is a folder; give the path of a {ending} file in it"
    if path.is_file():
        return "" if path.suffix == ending else f"{path} must end in {ending}; rename it"
    if path.exists():
        return f"{path} is no ordinary file; give the path of a {ending} file"
    where = "" if path.is_absolute() else f" in {Path.cwd()}"
    if not path.parent.is_dir():
        return f"no such file {path}{where}: there is no folder {path.parent}; check the path"
    stems = [each.stem for each in path.parent.glob(f"*{ending}")]
    near = difflib.get_close_matches(path.stem, stems, 1)
    hint = (
        f"did you mean {path.parent / near[0]}{ending}?"
        if near
        else "check the name and the folder"
    )
    return f"no such file {path}{where}; {hint}"


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
