"""Data sets: a folder of trials, one file each, and what a lab says about them in dataset.toml."""

import os
import re
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pma_gym.data.dataset_checks import check_signals, empty_runs
from pma_gym.data.dataset_toml import DESCRIPTION, Description, read_description
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.data.trial_files import TrialWarning, read_header, read_trial
from pma_gym.data.trial_formats import DECODERS
from pma_gym.data.trial_hints import strange_columns

PROPOSED = "next.csv"
"""Name of the commands that a diagnosis proposes; no trial until it has been measured."""

_UNKNOWN = "unknown columns"
_SHOWN = 3
"""Files that a warning names."""


@dataclass(frozen=True)
class NamedTrial:
    """A trial of a data set.

    Attributes:
        name: its file's name.
        trial: what was commanded and measured.
        order: when it was measured, as any number that grows; None if that is not told.
        repeat_of: name of the trial whose commands it repeats, or None.
        note: the lab's own words.
        file: name of the file that it is a piece of; None if it is a whole one.
    """

    name: str
    trial: Trial
    order: float | None = None
    repeat_of: str | None = None
    note: str = ""
    file: str | None = None


@dataclass(frozen=True)
class Dataset:
    """Trials that belong together: one rig, one muscle.

    Attributes:
        title: a line for people.
        model: name or path of the model to compare them with; None if none is named.
        trials: in the order of their files' names.
        tolerance: misfit that is good enough, by measurement (SI): `contraction`.
        standard_error: of readings that are rows of a table, by measurement (SI).
    """

    title: str
    model: str | None
    trials: tuple[NamedTrial, ...]
    tolerance: Mapping[str, float] = field(default_factory=dict)
    standard_error: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of trials."""
        return len(self.trials)


def read_dataset(folder: str | os.PathLike[str]) -> Dataset:
    """The trials in a folder: its CSV, Parquet and XLSX files, not those of folders in it.

    `dataset.toml` may give `title`, `model`, `[columns]` (the lab's names to ours, with factor and
    offset), `[trials."ramp.csv"]` with `order`, `repeat_of` and `note`, `[tolerance]` and
    `[standard_error]` (by measurement, in its unit). Hidden files and `next.csv` are passed over.

    Args:
        folder: the data set.
    Returns:
        The data set; a model given as a path is taken from the folder.
    Raises:
        TrialError: what cannot be used, in one message: file, row, column, rule and mend.
    Warns:
        TrialWarning: what was passed over, or looks odd.
    """
    folder = Path(folder)
    files = _files(folder)
    description = read_description(folder, [path.name for path in files])
    doubts: list[tuple[str, str]] = []
    trials = tuple(_named(path, description, doubts) for path in files)
    for message in _gathered(doubts, len(files)):
        warnings.warn(message, TrialWarning, stacklevel=2)
    return Dataset(
        description.title or folder.resolve().name,
        description.model,
        trials,
        description.tolerance,
        description.standard_error,
    )


def _files(folder: Path) -> list[Path]:
    """The files of a data set's trials, two of which never share a name."""
    if folder.is_file():
        raise TrialError(
            f"{folder} is a file; a data set is a folder with one file a trial: name the folder "
            "that holds it"
        )
    if not folder.is_dir():
        raise TrialError(f"there is no folder {folder}; check the name of the data set")
    found = [path for path in folder.iterdir() if _is_trial(path)]
    if not found:
        raise TrialError(f"{folder} holds no trial: {_instead(folder)}")
    stems = Counter(path.stem.lower() for path in found)
    for path in sorted(found):
        if stems[path.stem.lower()] > 1:
            twins = [other.name for other in sorted(found) if _stem(other) == _stem(path)]
            raise TrialError(
                f"{folder} holds {' and '.join(twins)}, two trials of one name; remove one, or "
                "rename it if it is a trial of its own"
            )
    if (folder / PROPOSED).is_file():
        warnings.warn(
            f"{PROPOSED} is passed over: a diagnosis writes its proposal under this name; rename "
            "the file if it is a measured trial",
            TrialWarning,
            stacklevel=3,
        )
    return sorted(found, key=_natural)


def _stem(path: Path) -> str:
    return path.stem.lower()


def _is_trial(path: Path) -> bool:
    """Whether a file of a folder is a trial's, by its name: no hidden file, no lock of Excel's."""
    named = path.suffix.lower() in DECODERS and path.name.lower() != PROPOSED
    return named and not path.name.startswith((".", "~$")) and path.is_file()


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts ramp10 after ramp2."""
    parts = re.findall(r"\d+|\D+", path.name.lower())
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


def _named(path: Path, description: Description, doubts: list[tuple[str, str]]) -> NamedTrial:
    """One trial, checked; what looks odd is added to `doubts` as (file, words)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TrialWarning)
        trial = read_trial(path, description.columns)
    words = [str(warning.message).removeprefix(path.name).lstrip(": ") for warning in caught]
    strange = ""
    if any(each.startswith(_UNKNOWN) for each in words):
        strange = strange_columns(read_header(path), description.columns, trial)
    if not trial.measurements:
        hint = f"; {strange}" if strange else ""
        raise TrialError(
            f"{path.name} has no measurement: name at least one column contraction_mm, "
            f"rotation_deg, load_n or pressure_kpa, or map it in [columns] of {DESCRIPTION}{hint}"
        )
    check_signals(path, trial, description.columns)
    words = [strange if each.startswith(_UNKNOWN) else each for each in words]
    doubts += [(path.name, each) for each in (*words, *empty_runs(path, trial))]
    about = description.trials.get(path.name, {})
    return NamedTrial(path.name, trial, **about)


def _gathered(doubts: list[tuple[str, str]], count: int) -> Iterator[str]:
    """One warning for each thing said, however many files it holds for."""
    files: dict[str, list[str]] = {}
    for file, words in doubts:
        files.setdefault(words, []).append(file)
    for words, names in files.items():
        shown = ", ".join(names[:_SHOWN])
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        every = "all files" if len(names) == count > 1 else f"{shown}{more}"
        yield f"{every}: {words}"
