"""The files of a data set's folder: those that are read, and messages on the others.

Files with the same content: a copy is no second measurement.

Copies make noise look repeatable and intervals too narrow. Contents are compared, not names: time
since the first row, commands and readings.
"""

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pma_gym.data.datasets.dataset_toml import Description
from pma_gym.data.files.trial_formats import DECODERS
from pma_gym.data.files.trial_loading import load_tables
from pma_gym.data.readers.table import PART, Table, UnreadableError
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError, suggestion

PROPOSED = "next.csv"
"""Name of the commands that a diagnosis proposes; no trial until it has been measured."""

_FREE_TEXT = (".txt", ".dat")
"""Ends of names that notes about a trial have as well."""
_LOCK = "~$"
"""Begins the names of the locks that spreadsheet programs keep beside open files."""
_SHOWN = 5


def list_files(folder: Path) -> tuple[list[Path], list[str]]:
    """The files of a folder that may be trials, by name, and words on the others.

    Raises:
        TrialError: no folder, or none of its files may be a trial.
    """
    if folder.is_file():
        raise TrialError(
            f"{folder} is a file; a data set is a folder with one file a trial: name the folder "
            "that holds it"
        )
    if not folder.is_dir():
        raise TrialError(f"there is no folder {folder}; check the name of the data set")
    plain = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    files = sorted(filter(_is_trial, plain), key=_natural)
    if not files:
        raise TrialError(f"{folder} holds no trial: {_instead(folder)}")
    return files, _others(path for path in plain if path not in set(files))


def _others(paths) -> list[str]:  # noqa: ANN001
    """Words on files that are no trials by their names."""
    said, strange = [], []
    for path in sorted(paths, key=_natural):
        if path.name.lower() == PROPOSED:
            said.append(
                f"{path.name} is passed over: a diagnosis writes its proposal under this name; "
                "rename the file if it is a measured trial"
            )
        elif path.name.startswith(_LOCK):
            said.append(
                f"{path.name} is passed over: a spreadsheet program locks an open file with it; "
                "what was not saved there is not read"
            )
        elif path.suffix.lower() != ".toml":
            strange.append(path.name)
    if strange:
        more = f" and {len(strange) - _SHOWN} more" if len(strange) > _SHOWN else ""
        said.append(
            f"passed over, as files of a kind that is not read: {', '.join(strange[:_SHOWN])}"
            f"{more}; save trials among them as CSV"
        )
    return said


def read_files(
    folder: Path, files: Sequence[Path], description: Description
) -> tuple[list[tuple[Path, Table]], list[str]]:
    """The tables in a data set's files, and words on files that hold none.

    Args:
        folder: the data set.
        files: those that may be trials.
        description: what `dataset.toml` says.
    Returns:
        Each table with its path, `march.xlsx#run2` where a file holds several.
    Raises:
        TrialError: no file can be read, two trials have one name, or `dataset.toml` names a part
            that is not there.
    """
    tables: list[tuple[Path, Table]] = []
    failures: list[UnreadableError] = []
    unread: list[Path] = []
    for path in files:
        try:
            read = load_tables(path, description.columns, description.form)
        except UnreadableError as error:
            failures.append(error)
            unread.append(path)
            continue
        several = len(read) > 1
        tables += [
            (path.with_name(f"{path.name}{PART}{t.part}") if several else path, t) for t in read
        ]
    if not tables:
        raise TrialError(f"{folder} holds no trial that can be read: {failures[0]}")
    notes = {path.name for path in unread if path.suffix.lower() in _FREE_TEXT}
    _check_twins(folder, [path.name for path in files if path.name not in notes])
    _check_parts(description, [path.name for path, _ in tables])
    return tables, [f"a file is passed over: {error}" for error in failures]


def _check_twins(folder: Path, names: Sequence[str]) -> None:
    stems = Counter(Path(name).stem.lower() for name in names)
    for name in sorted(names):
        if stems[Path(name).stem.lower()] > 1:
            twins = [n for n in sorted(names) if Path(n).stem.lower() == Path(name).stem.lower()]
            raise TrialError(
                f"{folder} holds {' and '.join(twins)}, two trials of one name; remove one, or "
                "rename it if it is a trial of its own"
            )


def _check_parts(description: Description, names: Sequence[str]) -> None:
    """Refuse what is said of a part that is not there, or of a file instead of its parts."""
    said = {**{name: name for name in description.trials}}
    said |= {
        table["repeat_of"]: name
        for name, table in description.trials.items()
        if table.get("repeat_of")
    }
    whole_files = {name.partition(PART)[0] for name in names}
    for name in said:
        if name not in names and name.partition(PART)[0] in whole_files:
            raise TrialError(
                f"dataset.toml names the trial {name!r}{suggestion(name, names)}, but the data set "
                f"has {', '.join(map(repr, list(names)[:_SHOWN]))}; write one of these"
            )


def _is_trial(path: Path) -> bool:
    """Whether a file of a folder may be a trial, by its name."""
    named = path.suffix.lower() in DECODERS and path.name.lower() != PROPOSED
    return named and not path.name.startswith((".", _LOCK)) and path.is_file()


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts ramp10 after ramp2."""
    parts = re.findall(r"[0-9]+|[^0-9]+", path.name.lower())
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _instead(folder: Path) -> str:
    """What a folder without a trial has instead, and what to do."""
    kinds = ", ".join(DECODERS)
    inner = sorted(
        path.name
        for path in folder.iterdir()
        if path.is_dir() and any(_is_trial(file) for file in path.iterdir())
    )
    if inner:
        return f"no {kinds} file lies in it, but some lie in {folder / inner[0]}; name that folder"
    others = sorted({path.suffix or path.name for path in folder.iterdir() if path.is_file()})
    has = f"its files end in {', '.join(others)}" if others else "it is empty"
    return f"no {kinds} file lies in it ({has}); save each trial as a CSV file with a header"


DIGITS = 9
"""Significant digits that are compared: a copy through a spreadsheet may lose the last ones."""


def copies(trials: Sequence[Trial]) -> dict[int, int]:
    """Find trials that repeat the content of an earlier one.

    Args:
        trials: the trials.
    Returns:
        Index of the earlier one by the index of the copy.
    """
    seen: dict[str, int] = {}
    originals = {}
    for number, trial in enumerate(trials):
        first = seen.setdefault(_content(trial), number)
        if first != number:
            originals[number] = first
    return originals


def _content(trial: Trial) -> str:
    """A digest of time, commands and readings."""
    digest = hashlib.sha256()
    columns = {"time": trial.time - trial.time[0], **trial.commands, **trial.measurements}
    for name in sorted(columns):
        values = columns[name]
        scale = float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
        # Plus 0: a negative zero has other bytes.
        whole = np.rint(values / scale * 10.0**DIGITS) + 0.0
        digest.update(name.encode() + np.nan_to_num(whole, nan=-1e300).tobytes())
    return digest.hexdigest()
