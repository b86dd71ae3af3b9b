"""Recognition of file paths, and reasons why a file cannot be read."""

import difflib
import os
from pathlib import Path


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
