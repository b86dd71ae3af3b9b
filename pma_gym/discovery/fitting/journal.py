"""What an interrupted diagnosis leaves: every finished fit, so that it can go on."""

import hashlib
import json
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pma_gym.data.trial import Trial
from pma_gym.document_shape import check_shape
from pma_gym.documents import parse_json, read_content
from pma_gym.effects.user_effects import loaded_digest
from pma_gym.files import replace_file
from pma_gym.plant.model import Model, dump_model

T = TypeVar("T")


class JournalWarning(UserWarning):
    """An entry of a journal that cannot be used; the message names its file."""


class Journal:
    """Finished fits by name, in a folder; or nothing at all.

    A fit is found again only for the same trials, model and question: its key holds their digest.

    Args:
        folder: where they are kept; made when the first one is; None keeps nothing.
        trials, model, question: what is asked.
    """

    def __init__(
        self, folder: Path | None, trials: Sequence[Trial], model: Model, question: str
    ) -> None:
        self._folder = folder
        self._warned = False
        self._digest = "" if folder is None else digest(trials, model, question)

    def entry(self, name: str) -> dict[str, Any] | None:
        """What was kept by a name, or None; a damaged entry is none."""
        return self.restored(name, dict)

    def restored(self, name: str, made: Callable[[dict[str, Any]], T]) -> T | None:
        """What is made of the entry that was kept by a name, or None.

        Args:
            name: of the entry.
            made: makes something of it; an error says that the entry is damaged.
        Warns:
            JournalWarning: once, that an entry is damaged: its fit is made anew.
        """
        path = self._path(name)
        if path is None or not path.is_file():
            return None
        try:
            content = read_content(path, "journal_mib")
            entry = parse_json(content, path.name, own=True, finite=False)
            check_shape(entry, dict)
            return made(entry)
        # Whatever an entry of another form leads to, its fit can be made again.
        except Exception as error:
            if not self._warned:
                self._warned = True
                warnings.warn(
                    f"{self._folder} holds a damaged fit ({path.name}: {type(error).__name__}: "
                    f"{error}); damaged fits are computed anew, the others stay",
                    JournalWarning,
                    stacklevel=3,
                )
            return None

    def keep(self, name: str, entry: dict[str, Any]) -> None:
        """Keep an entry; its file is there whole or not at all."""
        path = self._path(name)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, json.dumps(entry).encode())

    def _path(self, name: str) -> Path | None:
        if self._folder is None:
            return None
        key = hashlib.sha256(f"{self._digest} {name}".encode()).hexdigest()[:24]
        return self._folder / f"{key}.json"


def digest(trials: Sequence[Trial], model: Model, question: str) -> str:
    """What trials, a model and a question are, in a few characters."""
    checksum = hashlib.sha256(question.encode())
    checksum.update(dump_model(model).encode())
    checksum.update(loaded_digest().encode())
    for trial in trials:
        for name, values in (
            ("time", trial.time),
            *sorted(trial.commands.items()),
            *sorted(trial.measurements.items()),
        ):
            checksum.update(name.encode())
            checksum.update(np.ascontiguousarray(values, float).tobytes())
    return checksum.hexdigest()
