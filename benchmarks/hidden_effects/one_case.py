"""One case from the draw to the answer, in whatever process."""

import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects import records
from benchmarks.hidden_effects.blocks import Block
from benchmarks.hidden_effects.files import case_name, write_case

Judge = Callable[[Path], dict[str, Any]]
"""What `diagnosed` is."""


def diagnosed(folder: Path) -> dict[str, Any]:
    """A data set's `diagnosis.json`.

    The files are read back as a user's would be, and the diagnosis is that of `pma-gym diagnose`
    with its defaults, without the start of a process.
    """
    # Here, for other judges need none of it.
    from pma_gym.data.dataset import read_dataset
    from pma_gym.discovery import diagnose

    return diagnose(read_dataset(folder), jobs=1).document()


@dataclass(frozen=True)
class Work:
    """A case to draw, to diagnose and to keep a record of.

    Attributes:
        block: its block.
        seed: of the set.
        number: of the case, 1 and up.
        folder: of the set.
        keep: keep the trials too, in `folder/data`.
        code: fingerprint of the code, for the record.
        judge: makes the answer.
    """

    block: Block
    seed: int
    number: int
    folder: Path
    keep: bool = False
    code: str = ""
    judge: Judge = diagnosed

    def __call__(self) -> records.Record:
        """Do it; what the diagnosis raises becomes the record's message."""
        begun = time.perf_counter()
        case = self.block.draw(self.seed, self.number)
        drawn = time.perf_counter()
        place = self.folder / "data" if self.keep else Path(tempfile.mkdtemp(prefix="hidden_"))
        try:
            write_case(case, place, self.number)
            answer, message = self._answer(place / "cases" / case_name(self.number))
        finally:
            if not self.keep:
                shutil.rmtree(place, ignore_errors=True)
        seconds = {"draw": drawn - begun, "diagnose": time.perf_counter() - drawn}
        record = records.Record(
            self.number,
            case.truth,
            answer and records.essentials(answer),
            message,
            seconds={name: round(took, 3) for name, took in seconds.items()},
            code=self.code,
        )
        records.write(record, self.folder)
        return record

    def _answer(self, folder: Path) -> tuple[dict[str, Any] | None, str]:
        """The answer, or none and what was raised instead."""
        try:
            return self.judge(folder), ""
        except Exception as error:
            return None, f"{type(error).__name__}: {error}"
