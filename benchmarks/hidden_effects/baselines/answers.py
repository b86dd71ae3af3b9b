"""Drawn cases through every baseline; an answer that is there is kept, so that a run goes on."""

import itertools
import json
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.executors.choice import local
from benchmarks.executors.executor import run_or_raise
from benchmarks.hidden_effects.baselines.registry import BASELINES
from benchmarks.hidden_effects.evaluation.measured import measured_now
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.files import replace_file


@dataclass(frozen=True)
class Question:
    """One case for one baseline.

    Attributes:
        baseline: name of the baseline.
        case: folder of the case's trials.
        file: where the answer goes.
    """

    baseline: str
    case: Path
    file: Path


def open_questions(folder: Path, baselines: Sequence[str]) -> tuple[list[Question], int]:
    """What has no answer yet in a folder that `draw` wrote, and how many questions there are."""
    cases = sorted((folder / "cases").glob("case_*"))
    every = [Question(baseline, case, answer_file(folder, baseline, case.name))
             for case in cases for baseline in baselines]  # fmt: skip
    return [each for each in every if not each.file.is_file()], len(every)


def answer_file(folder: Path, baseline: str, case: str) -> Path:
    """Where a baseline's answer about a case is kept."""
    return folder / "answers" / baseline / f"{case}.json"


def ask_all(folder: Path, baselines: Sequence[str], jobs: int, seed: int = 0) -> None:
    """Run each baseline on the cases that it has not answered; answers go to folder/answers/NAME.

    Args:
        folder: what `draw` wrote.
        baselines: names of baselines that are installed.
        jobs: processes.
        seed: of what a baseline draws.
    """
    missing, count = open_questions(folder, baselines)
    print(f"{count - len(missing)} of {count} answers are there already", file=sys.stderr)
    for baseline in baselines:
        (folder / "answers" / baseline).mkdir(parents=True, exist_ok=True)
    begun, done = time.monotonic(), itertools.count(1)

    def tell(_: int, words: str) -> None:
        _tell(next(done), len(missing), words, begun)

    run_or_raise([partial(ask, each, seed) for each in missing], local(jobs), tell)


def ask(question: Question, seed: int) -> str:
    """Ask, keep the answer with the seconds that it took, and say what came."""
    begun = time.perf_counter()
    answer: dict[str, Any]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = dict(BASELINES[question.baseline].ask(read_dataset(question.case), seed, 1))
    except Exception as error:
        # A baseline that fails has no answer, and that counts.
        answer = {"error": f"{type(error).__name__}: {error}"}
    answer["measured"] = measured_now()
    answer["seconds"] = round(time.perf_counter() - begun, 3)
    replace_file(question.file, (json.dumps(answer, indent=1) + "\n").encode())
    return f"{question.case.name} {question.baseline}: {_said(answer)}"


def _said(answer: dict[str, Any]) -> str:
    names = "+".join(each["name"] for each in answer.get("effects", ()))
    return names or answer.get("verdict") or answer["error"]


def _tell(done: int, count: int, words: str, begun: float) -> None:
    took = time.monotonic() - begun
    print(f"{done}/{count}  {words}  ({took:.0f} s)", file=sys.stderr, flush=True)
