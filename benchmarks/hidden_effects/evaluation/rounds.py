"""Experiments that follow: what the diagnosis proposes, or a random one as long, on the same rig.

A round carries the experiment out on the case's rig, with new noise of the same kind, adds the
trial to the data set and asks again. It ends when an effect is named, rightly or not, or when
the diagnosis no longer asks for an experiment.

One case from the draw to the answer, in any process.

Asking for a diagnosis of a case: files are written, and read back as a user's would be.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.evaluation import records
from benchmarks.hidden_effects.evaluation.verdicts import compare, judged
from benchmarks.hidden_effects.generation.cases import Block, Case, measure
from benchmarks.hidden_effects.generation.files import (
    Volts,
    case_name,
    random_experiment,
    write_case,
)
from benchmarks.hidden_effects.physics.rig import Array
from benchmarks.hidden_effects.physics.simulation import RATE
from pma_gym.partials import begin_temporary_folder, end_partial


@dataclass(frozen=True)
class Answer:
    """Answer of a diagnosis.

    Attributes:
        document: its `diagnosis.json`; None where it gave none.
        message: what it raised instead.
        following: motor and regulator voltages of the experiment that it proposes, shape (rows,)
            each; None without a proposal.
    """

    document: dict[str, Any] | None
    message: str = ""
    following: tuple[Array, Array] | None = None


Judge = Callable[[Path], Answer]
"""What `diagnosed` is: takes the folder of a data set."""


def unproposed(folder: Path) -> Answer:
    """As `diagnosed`, without the seconds that a proposal takes."""
    return diagnosed(folder, propose=False)


def diagnosed(folder: Path, propose: bool = True) -> Answer:
    """The answer of `pma-gym diagnose` with its defaults, without the start of a process."""
    # Here, for other judges need none of it.
    from pma_gym.data.datasets.dataset import read_dataset
    from pma_gym.discovery import diagnose

    diagnosis = diagnose(read_dataset(folder), jobs=1, propose=propose)
    proposal, following = diagnosis.next_experiment, None
    if proposal is not None:
        commands = proposal.trial.commands
        motor, regulator = (
            np.round(commands[name], 3) for name in ("motor_voltage", "regulator_voltage")
        )
        following = motor, regulator
    return Answer(diagnosis.document(), following=following)


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


CHOOSERS = ("proposed", "random")
"""Who chooses the experiment. The random one's length is that of the first proposal."""

Round = dict[str, Any]


def follow(case: Case, first: Answer, rounds: int, judge: Judge) -> dict[str, list[Round]]:
    """Results of the rounds by each chooser; nothing where the first answer asks for none.

    Args:
        case: its truth tells the rig.
        first: the answer to it.
        rounds: how many at most.
        judge: makes the answers.
    """
    if first.following is None or named(case, first):
        return {}
    return {chooser: _chosen(chooser, case, first, rounds, judge) for chooser in CHOOSERS}


def named(case: Case, answer: Answer) -> bool:
    """Whether an answer names an effect, rightly or not."""
    return answer.document is not None and compare(case.truth, answer.document).verdict == "effect"


def _chosen(chooser: str, case: Case, answer: Answer, rounds: int, judge: Judge) -> list[Round]:
    assert answer.following is not None
    rows, done = len(answer.following[0]), list[Round]()
    for k in range(rounds):
        if answer.following is None or named(case, answer):
            break
        seed = [case.truth["seed"], case.truth["number"], 1 + k, CHOOSERS.index(chooser)]
        g = np.random.default_rng(seed)
        excitation, volts = "", answer.following
        if chooser == "random":
            excitation, volts = random_experiment(g, rows)
        elif answer.document is not None:
            excitation = answer.document["next_experiment"]["excitation"]
        case = with_trial(case, volts, g)
        start = time.perf_counter()
        answer = asked(case, case.truth["number"], judge)
        done.append(_round(case, answer, excitation) | {"seconds": time.perf_counter() - start})
    return done


def with_trial(case: Case, volts: Volts, g: np.random.Generator) -> Case:
    """A case with one trial more, made on its rig."""
    motor, regulator = volts
    (readings,) = measure(case.truth, motor[None], regulator[None], len(case.motor), g)
    return replace(
        case,
        time=[*case.time, np.arange(len(motor)) / RATE],
        motor=[*case.motor, motor],
        regulator=[*case.regulator, regulator],
        readings=[*case.readings, readings],
    )


def _round(case: Case, answer: Answer, excitation: str) -> Round:
    said = "no answer"
    if answer.document is not None:
        said = compare(case.truth, answer.document).said
    hidden = [effect["name"] for effect in case.truth["effects"]]
    return {"excitation": excitation, "said": said, **judged(said, hidden)}


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
        # Where no experiment follows, none need be proposed.
        idle = self.judge is diagnosed and not self.block.rounds
        answer = asked(case, self.number, unproposed if idle else self.judge, kept)
        answered = time.perf_counter()
        rounds = {}
        if self.block.rounds:
            # Here, for it compiles the package's library of experiments.

            rounds = follow(case, answer, self.block.rounds, self.judge)
        ends = {"draw": drawn - start, "diagnose": answered - drawn}
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
