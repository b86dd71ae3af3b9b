"""`python -m benchmarks hidden-effects`: draw and diagnose a block, case by case; count."""

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from benchmarks.executors.executor import Executor, ThisProcess, run_all
from benchmarks.files import UNREADABLE, reason, say_damaged, write_text
from benchmarks.hidden_effects.evaluation import records, scoring
from benchmarks.hidden_effects.evaluation.answers import Judge, Work, diagnosed
from benchmarks.hidden_effects.evaluation.records import CaseRecord, measured_now
from benchmarks.hidden_effects.evaluation.summary import report
from benchmarks.hidden_effects.evaluation.targets import RATES, percent
from benchmarks.hidden_effects.evaluation.verdicts import Outcome
from benchmarks.hidden_effects.generation.cases import BLOCKS, Block
from benchmarks.runner.fingerprint import code_digest_with
from pma_gym.document_shape import ListOf, ShapeError, Whole, check_shape
from pma_gym.documents import read_json

FAILED, INTERRUPTED = 1, 130
"""Exit codes."""

ALL = "all"
"""Name of all blocks together."""

SET, SCORE = "set.json", "score.json"
"""What a folder holds, and its figures."""


class JobError(ValueError):
    """An order that cannot be carried out; the message names what, the rule and the fix."""


@dataclass(frozen=True)
class Order:
    """Request for a campaign.

    Attributes:
        block: the block.
        count: how many cases.
        seed: of the set.
        folder: of its records.
        executor: where cases are drawn and diagnosed.
        keep: keep the trials too.
        recompute: anew what other code made.
        judge: makes the answers.
    """

    block: Block
    count: int
    seed: int
    folder: Path
    executor: Executor = field(default_factory=ThisProcess)
    keep: bool = False
    recompute: bool = False
    judge: Judge = diagnosed


def ordered(block: str) -> list[Block]:
    """Blocks of a name, all of them of `all`.

    Raises:
        JobError: there is no such block.
    """
    if block == ALL:
        return list(BLOCKS.values())
    if block not in BLOCKS:
        raise JobError(f"--block {block}: no such block; choose {', '.join([*BLOCKS, ALL])}")
    return [BLOCKS[block]]


def run_block(order: Order) -> dict[str, Any] | None:
    """Draw and diagnose the cases that are missing; the figures of all, None if interrupted.

    Each finished case is kept at once, so the same order goes on after Ctrl-C or a kill, and a
    larger count extends the set. The figures are also written to the folder.

    Raises:
        JobError: the folder holds another set.
    """
    _claim(order)
    code, now = fingerprint(), measured_now()
    done = {
        record.number: record
        for record in judgeable(order)
        if record.code == code or not order.recompute
    }
    _tell(_greeting(order, done, code))
    missing = [number for number in range(1, order.count + 1) if number not in done]
    works = [
        Work(order.block, order.seed, number, order.folder, order.keep, code, order.judge)
        for number in missing
    ]
    progress = Progress(order, [scoring.outcome_of(record) for record in done.values()])
    failures: list[str] = []

    def on_done(index: int, result: object) -> None:
        if isinstance(result, CaseRecord):
            done[result.number] = replace(result, measured=now)
            records.write(done[result.number], order.folder)
            progress.tell(result)
        else:
            failures.append(f"case {missing[index]}: {type(result).__name__}: {result}")
            _tell(failures[-1])

    if not run_all(works, order.executor, on_done):
        _tell(
            f"Interrupted: {len(done)} of {order.count} cases of {order.block.name} are done and "
            f"stay in {order.folder}; the same command goes on from there."
        )
        return None
    document = figures(order, [done[number] for number in sorted(done)]) | {"failures": failures}
    write_text(order.folder / SCORE, json_text(document))
    return document


def judgeable(order: Order) -> list[CaseRecord]:
    """Records of an order's folder that can be judged; the other cases are made anew."""
    kept_records, damaged = list[CaseRecord](), list[str]()
    for record in records.read(order.folder, order.count):
        try:
            if record.truth["seed"] != order.seed:
                raise ValueError(f"it is of seed {record.truth['seed']!r}")
            scoring.count([scoring.outcome_of(record)])
            kept_records.append(record)
        except UNREADABLE as error:
            name = records.path_of(order.folder, record.number).name
            damaged.append(f"{name}: {reason(error)}")
    records.say_lost(order.folder, damaged)
    return kept_records


def figures(order: Order, kept: Sequence[CaseRecord]) -> dict[str, Any]:
    """The figures of a block's records."""
    counted = scoring.count([scoring.outcome_of(record) for record in kept])
    measured = {tuple(record.measured.items()): record.measured for record in kept}
    for block in counted["blocks"].values():
        block["measured"] = list(measured.values())
    return {"schema": 1, "seed": order.seed, **counted}


def merged(documents: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Several blocks' figures as one document."""
    blocks: dict[str, Any] = {}
    for document in documents:
        blocks |= document["blocks"]
    # A document that was merged before has a list of them.
    listed = [document["seed"] for document in documents]
    seeds = sorted({s for each in listed for s in (each if isinstance(each, list) else [each])})
    failures = [each for document in documents for each in document["failures"]]
    return {
        "schema": 1,
        "seed": seeds[0] if len(seeds) == 1 else seeds,
        "blocks": blocks,
        "failures": failures,
    }


_MEASURED = ListOf({"commit": str, "date": str, "method": str}, 1)
_SCORE = {"seed": object, "blocks": {"*": {"measured": _MEASURED}}, "failures": ListOf(str)}
"""Shape of the figures that the job writes."""


def read_scores(places: Sequence[Path]) -> dict[str, Any]:
    """Figures of folders that the job filled, or of its JSON files, as one document.

    Raises:
        JobError: nothing to read, no figures in it, or two sets of one block.
    """
    documents = []
    for place in places:
        path = place / SCORE if place.is_dir() else place
        if not path.is_file():
            raise JobError(
                f"{path}: there is no such file; name a folder in which `python -m benchmarks "
                "hidden-effects` ended, or a .json file of hidden-effects-report"
            )
        try:
            document = read_json(path, "journal_mib", own=True)
        except ValueError as error:
            raise JobError(
                f"{path} is no JSON file ({error}); name one that the job wrote"
            ) from None
        try:
            check_shape(document, _SCORE)
        except ShapeError as error:
            raise JobError(
                f"{path} holds no figures of `python -m benchmarks hidden-effects` ({error}); run "
                "it again, or name another"
            ) from None
        documents.append(document)
    names = [name for document in documents for name in document["blocks"]]
    for name in names:
        if names.count(name) > 1:
            raise JobError(f"block {name} is in {names.count(name)} of the files; name it once")
    return merged(documents)


def run_hidden_effects(orders: Sequence[Order]) -> int:
    """Run blocks one after the other and print their figures.

    Returns:
        Exit code: 0, 1 if a case could not be drawn or its process died, 130 if interrupted.
    Raises:
        JobError: a folder holds another set.
    """
    code = 0
    for order in orders:
        document = run_block(order)
        if document is None:
            return INTERRUPTED
        print(report(document), flush=True)
        code = FAILED if document["failures"] else code
    return code


def json_text(document: dict[str, Any]) -> str:
    """A document as its file has it."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def fingerprint() -> str:
    """Of all code that a record depends on: the package's and the generator's."""
    here = Path(__file__).parent
    folders = (here / "generation", here / "physics", here / "rigs", here / "evaluation")
    files = [file for folder in folders for file in sorted(folder.rglob("*.py"))]
    return code_digest_with([*sorted(here.glob("*.py")), *files])


class Progress:
    """A line a case: what was hidden and said, the rate so far, the time left."""

    def __init__(self, order: Order, known: Sequence[Outcome]) -> None:
        self.order, self.outcomes = order, list(known)
        self.start, self.before = time.monotonic(), len(known)

    def tell(self, record: CaseRecord) -> None:
        """One more case is done."""
        outcome = scoring.outcome_of(record)
        self.outcomes.append(outcome)
        done, count = len(self.outcomes), self.order.count
        left = (time.monotonic() - self.start) / (done - self.before) * (count - done)
        size = "" if outcome.ratio is None else f" (r {outcome.ratio:.2f})"
        answer = outcome.said if outcome.answered else f"NO ANSWER, {outcome.sentence}"
        first = RATES[self.order.block.name][0]
        rate = scoring.rate(map(first.hit, self.outcomes))
        _tell(
            f"{done}/{count}  {record.number}: {outcome.hidden}{size}, said {answer};  "
            f"{first.name} {percent(rate)};  {_time(left)} left"
        )


def _claim(order: Order) -> None:
    """Make a folder this set's own.

    Raises:
        JobError: it is another's, or no folder.
    """
    mine = {"block": order.block.name, "seed": order.seed}
    path = order.folder / SET
    if order.folder.exists() and not order.folder.is_dir():
        raise JobError(f"--out {order.folder} is a file; name a folder for the results")
    if path.is_file():
        theirs = _claimed(path)
        if theirs is not None and theirs != mine:
            raise JobError(
                f"--out {order.folder} holds block {theirs['block']} of seed {theirs['seed']}, "
                f"not {order.block.name} of seed {order.seed}; name another folder"
            )
        if theirs is not None:
            return
    write_text(path, json.dumps(mine) + "\n")


def _claimed(path: Path) -> dict[str, Any] | None:
    """Whose set a folder holds; None where the file is damaged and no record is of another's."""
    try:
        theirs = read_json(path)
        check_shape(theirs, {"block": str, "seed": Whole()})
    except ValueError as error:
        say_damaged(path, str(error), "it is written anew")
        return None
    return theirs


def _greeting(order: Order, done: dict[int, CaseRecord], code: str) -> str:
    text = (
        f"Block {order.block.name}, seed {order.seed}: {order.count} cases, "
        f"{order.executor.jobs} at a time"
    )
    if done:
        text += f"; {len(done)} are done in {order.folder}"
    other = sum(record.code != code for record in done.values())
    if other:
        text += f", {other} of them by other code than this (--recompute makes those anew)"
    return text


def _time(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{minutes // 60} h {minutes % 60:02d} min"


def _tell(message: str) -> None:
    print(message, file=sys.stderr, flush=True)
