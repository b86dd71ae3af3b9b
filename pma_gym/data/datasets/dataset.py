"""Data sets: a folder of trials, one file each, and the lab's description in dataset.toml."""

import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from pma_gym.data.datasets.dataset_checks import check_signals, empty_runs
from pma_gym.data.datasets.dataset_files import PROPOSED, list_files, read_files
from pma_gym.data.datasets.dataset_toml import DESCRIPTION, Description, read_description
from pma_gym.data.datasets.lab_sensors import LabSensor, without_ends
from pma_gym.data.files.even_clock import held_commands
from pma_gym.data.files.trial_files import TrialWarning, trial_of
from pma_gym.data.files.trial_hints import strange_columns
from pma_gym.data.quality.lone_readings import outliers
from pma_gym.data.readers.table import FileFormat, Table
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY, ColumnMap, TrialError
from pma_gym.files import as_path
from pma_gym.units import SI_FACTORS

__all__ = ["PROPOSED", "Dataset", "NamedTrial", "read_dataset"]

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
        folder: where they were read from; None for trials that are no files.
        columns: the lab's names to ours, as `dataset.toml` has them.
        form: separator, decimal mark... of its files, as `dataset.toml` has them.
        checked: what the checks of the data said; None before they ran.
        tolerance: misfit that is good enough, by measurement (SI): `contraction`.
        standard_error: of readings that are rows of a table, by measurement (SI).
        sensors: what the lab states of its sensors, by measurement.
    """

    title: str
    model: str | None
    trials: tuple[NamedTrial, ...]
    folder: Path | None = None
    columns: ColumnMap = field(default_factory=dict)
    form: FileFormat = field(default_factory=FileFormat)
    checked: tuple[str, ...] | None = None
    tolerance: Mapping[str, float] = field(default_factory=dict)
    standard_error: Mapping[str, float] = field(default_factory=dict)
    sensors: Mapping[str, LabSensor] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of trials."""
        return len(self.trials)


def read_dataset(folder: str | os.PathLike[str]) -> Dataset:
    """The trials in a folder: its files of every kind that is read, not those of folders in it.

    A file with several sheets, segments, groups or structures holds as many trials, with names like
    `march.xlsx#run2`. `dataset.toml` may give `title`, `model`, `[columns]` (the lab's names to
    ours, with factor and offset), `[format]`, `[trials."ramp.csv"]` with `order`, `repeat_of`,
    `note` and `memory_at_start` (of the muscle's hysteresis, -1 to 1), `[tolerance]`,
    `[standard_error]` and `[sensors]` (by measurement, in its unit). Hidden files and
    TOML files are passed over silently, all others with a warning.

    Args:
        folder: the data set.
    Returns:
        The data set; a model given as a path is taken from the folder.
    Raises:
        TrialError: what cannot be used, in one message: file, row, column, rule and mend.
    Warns:
        TrialWarning: what was passed over, or looks odd.
    """
    folder = as_path(folder, TrialError)
    files, passed = list_files(folder)
    description = read_description(folder, [path.name for path in files])
    tables, unread = read_files(folder, files, description)
    for message in (*passed, *unread):
        warnings.warn(message, TrialWarning, stacklevel=2)
    doubts: list[tuple[str, str]] = []
    trials = tuple(_named(path, table, description, doubts) for path, table in tables)
    for message in _gathered(doubts, len(tables)):
        warnings.warn(message, TrialWarning, stacklevel=2)
    return Dataset(
        description.title or folder.resolve().name,
        description.model,
        trials,
        folder,
        description.columns,
        description.form,
        tolerance=description.tolerance,
        standard_error=description.standard_error,
        sensors=description.sensors,
    )


def _named(
    path: Path, table: Table, description: Description, doubts: list[tuple[str, str]]
) -> NamedTrial:
    """One trial, checked; what looks odd is added to `doubts` as (file, words)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TrialWarning)
        trial = trial_of(table, description.columns, description.form)
    messages = [str(warning.message).removeprefix(path.name).lstrip(": ") for warning in caught]
    strange = ""
    if any(each.startswith(_UNKNOWN) for each in messages):
        strange = strange_columns(table.header, description.columns, trial)
    if not trial.measurements:
        hint = f"; {strange}" if strange else ""
        raise TrialError(
            f"{path.name} has no measurement: name at least one column contraction_mm, "
            f"rotation_deg, load_n or pressure_kpa, or map it in [columns] of {DESCRIPTION}{hint}"
        )
    check_signals(table, trial, description.columns)
    messages = [strange if each.startswith(_UNKNOWN) else each for each in messages]
    doubts += [
        (path.name, each)
        for each in (
            *messages,
            *held_commands(trial, description.form.interpolation == "zoh"),
            *empty_runs(trial, table),
            *_outliers(trial, table),
        )
    ]
    trial = without_ends(
        trial, description.sensors, lambda messages: doubts.append((path.name, messages))
    )
    about = {**description.trials.get(path.name, {})}
    memory_at_start = about.pop("memory_at_start", None)
    return NamedTrial(path.name, replace(trial, memory_at_start=memory_at_start), **about)


def _outliers(trial: Trial, table: Table) -> Iterator[str]:
    """Messages about outliers of a trial."""
    values = {
        name: readings / SI_FACTORS[BY_QUANTITY[name].unit]
        for name, readings in trial.measurements.items()
    }
    return outliers(values, table.place)


def _gathered(doubts: list[tuple[str, str]], count: int) -> Iterator[str]:
    """One warning for each thing said, however many files it holds for."""
    files: dict[str, list[str]] = {}
    for file, message in doubts:
        files.setdefault(message, []).append(file)
    for message, names in files.items():
        shown = ", ".join(names[:_SHOWN])
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        every = "all files" if len(names) == count > 1 else f"{shown}{more}"
        yield f"{every}: {message}"
