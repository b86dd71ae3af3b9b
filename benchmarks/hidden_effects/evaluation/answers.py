"""One case from the draw to the answer, in any process: files are written and read back."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects.evaluation import records
from benchmarks.hidden_effects.generation.cases import Block, Case
from benchmarks.hidden_effects.generation.files import case_name, write_case
from pma_gym.partials import begin_temporary_folder, end_partial


@dataclass(frozen=True)
class Answer:
    """Answer of a diagnosis.

    Attributes:
        document: its `diagnosis.json`; None where it gave none.
        message: what it raised instead.
    """

    document: dict[str, Any] | None
    message: str = ""


Judge = Callable[[Path], Answer]
"""What `diagnosed` is: takes the folder of a data set."""


def diagnosed(folder: Path) -> Answer:
    """The answer of `pma-gym diagnose`, without a proposed experiment and a process of its own."""
    # Here, for other judges need none of it.
    from pma_gym.data.datasets.dataset import read_dataset
    from pma_gym.discovery import diagnose

    return Answer(diagnose(read_dataset(folder), jobs=1, propose=False).document())


def asked(case: Case, number: int, judge: Judge, keep: Path | None = None) -> Answer:
    """A judge's answer to a case; what it raises becomes the answer's message.

    Args:
        case: the case, of whose truth the judge sees nothing.
        number: of the case.
        judge: makes the answer.
        keep: folder in which the files stay; none do if not given.
    """
    place = begin_temporary_folder("hidden_effects") if keep is None else keep
    try:
        write_case(case, place, number)
        return judge(place / "cases" / case_name(number))
    except Exception as error:
        return Answer(None, f"{type(error).__name__}: {error}")
    finally:
        if keep is None:
            with suppress(OSError):
                end_partial(place)


@dataclass(frozen=True)
class Work:
    """A case to draw and to diagnose; its result is a record.

    Attributes:
        block: its block.
        seed: of the set.
        number: of the case, 1 and up.
        folder: of the set.
        keep: keep the trials too, in `folder/data`.
        code: fingerprint of the code, for the record.
        judge: makes the answer; what it raises becomes the record's message.
    """

    block: Block
    seed: int
    number: int
    folder: Path
    keep: bool = False
    code: str = ""
    judge: Judge = diagnosed

    def __call__(self) -> records.CaseRecord:
        """Do it."""
        start = time.perf_counter()
        case = self.block.draw(self.seed, self.number)
        drawn = time.perf_counter()
        kept = self.folder / "data" if self.keep else None
        answer = asked(case, self.number, self.judge, kept)
        ends = {"draw": drawn - start, "diagnose": time.perf_counter() - drawn}
        return records.CaseRecord(
            self.number,
            case.truth,
            answer.document and records.essentials(answer.document),
            answer.message,
            {name: round(took, 3) for name, took in ends.items()},
            self.code,
        )
