"""Many cases, in processes; what is there already is kept."""

import os
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_or_raise
from benchmarks.hidden_effects.generation.cases import Case, draw_case
from benchmarks.hidden_effects.generation.effects import KINDS
from benchmarks.hidden_effects.generation.files import case_name, is_written, write_case
from benchmarks.hidden_effects.generation.undecidable import BLOCKS as EVERY


@dataclass(frozen=True)
class CaseSet:
    """Distribution of cases.

    Attributes:
        seed: of all of them.
        blocks: cases take turns in them.
        effects: cases of block `single` take turns in them; in all if empty.
        ratio: range of the target ratio r.
        trials: of a case.
        seconds: of a trial.
    """

    seed: int
    blocks: tuple[str, ...]
    effects: tuple[str, ...] = ()
    ratio: tuple[float, float] = (0.5, 2.0)
    trials: int = 6
    seconds: float = 8.0

    def block(self, number: int) -> str:
        """Block of a case; numbers begin at 1."""
        return self.blocks[(number - 1) % len(self.blocks)]

    def hidden(self, number: int) -> tuple[str, ...] | None:
        """What a case hides; None where chance decides."""
        if self.block(number) != "single":
            return None
        names = self.effects or tuple(KINDS)
        turn = sum(self.block(k) == "single" for k in range(1, number))
        return (names[turn % len(names)],)


def draw(case_set: CaseSet, count: int, folder: Path, jobs: int) -> None:
    """Draw cases 1 to `count` into a folder; one after the other, or in processes.

    Args:
        case_set: what they are like.
        count: how many.
        folder: what has been written there whole is kept.
        jobs: processes.
    """
    places = range(1, count + 1)
    _write({place: partial(_draw_one, case_set, place, folder) for place in places}, folder, jobs)


def take(blocks: Mapping[str, int], seed: int, folder: Path, jobs: int) -> None:
    """Write the first cases of some blocks into a folder, as the benchmark itself draws them.

    Args:
        blocks: names of blocks, and how many cases of each.
        seed: of the blocks.
        folder: what has been written there whole is kept; a case's truth has its block and number.
        jobs: processes.
    """
    every = [(name, number) for name, count in blocks.items() for number in range(1, count + 1)]
    work = {
        place: partial(_take_one, block, seed, number, place, folder)
        for place, (block, number) in enumerate(every, 1)
    }
    _write(work, folder, jobs)


def _write(work: Mapping[int, Callable[[], str]], folder: Path, jobs: int) -> None:
    """Make the cases that a folder lacks, by their places there."""
    missing = [make for place, make in work.items() if not is_written(folder, place)]
    count = len(work)
    began, done = time.monotonic(), count - len(missing)
    if done:
        print(f"{done} of {count} cases are there already", file=sys.stderr)
    if jobs > 1:
        # A process a core; numpy's own threads would only get in each other's way.
        os.environ["OMP_NUM_THREADS"] = "1"

    def tell(_: int, message: str) -> None:
        nonlocal done
        done += 1
        _tell(done, count, message, began)

    run_or_raise(missing, local(jobs), tell)


def _draw_one(case_set: CaseSet, number: int, folder: Path) -> str:
    block = case_set.block(number)
    hidden = case_set.hidden(number)
    case = draw_case(
        case_set.seed, number, block, hidden, case_set.trials, case_set.seconds, case_set.ratio
    )
    return _kept(case, folder, number)


def _take_one(block: str, seed: int, number: int, place: int, folder: Path) -> str:
    return _kept(EVERY[block].draw(seed, number), folder, place)


def _kept(case: Case, folder: Path, place: int) -> str:
    """Write a case; what it is, in words."""
    write_case(case, folder, place)
    sizes = ", ".join(f"{e['name']} r {e['r']:.2f}" for e in case.truth["effects"])
    return f"{case_name(place)} {case.truth['block']} {sizes}"


def _tell(done: int, count: int, message: str, began: float) -> None:
    took = time.monotonic() - began
    print(f"{done}/{count}  {message}  ({took:.0f} s)", file=sys.stderr, flush=True)
