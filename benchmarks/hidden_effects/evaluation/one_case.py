"""One case from the draw to the answer, in any process."""

import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.hidden_effects.evaluation import records
from benchmarks.hidden_effects.evaluation.diagnosis import Judge, asked, diagnosed, unproposed
from benchmarks.hidden_effects.generation.blocks import Block


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
        begun = time.perf_counter()
        case = self.block.draw(self.seed, self.number)
        drawn = time.perf_counter()
        kept = self.folder / "data" if self.keep else None
        # Where no experiment follows, none need be proposed.
        idle = self.judge is diagnosed and not self.block.rounds
        answer = asked(case, self.number, unproposed if idle else self.judge, kept)
        answered = time.perf_counter()
        rounds = {}
        if self.block.rounds:
            # Here, for it compiles the package's library of experiments.
            from benchmarks.hidden_effects.evaluation.rounds import follow

            rounds = follow(case, answer, self.block.rounds, self.judge)
        ends = {"draw": drawn - begun, "diagnose": answered - drawn}
        ends["rounds"] = time.perf_counter() - answered
        return records.CaseRecord(
            self.number,
            case.truth,
            answer.document and records.essentials(answer.document),
            answer.message,
            rounds,
            {name: round(took, 3) for name, took in ends.items()},
            self.code,
            self.block.rounds,
        )
