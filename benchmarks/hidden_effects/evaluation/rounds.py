"""Experiments that follow: what the diagnosis proposes, or a random one as long, on the same rig.

A round carries the experiment out on the case's rig, with new noise of the same kind, adds the
trial to the data set and asks again. It ends when an effect is named, rightly or not, or when
the diagnosis no longer asks for an experiment.
"""

import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.hidden_effects.evaluation.diagnosis import Answer, Judge, asked
from benchmarks.hidden_effects.evaluation.verdicts import compare, judged
from benchmarks.hidden_effects.generation.cases import Case, measure
from benchmarks.hidden_effects.generation.files import Volts, random_experiment
from benchmarks.hidden_effects.physics.simulation import RATE

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
        words, volts = "", answer.following
        if chooser == "random":
            words, volts = random_experiment(g, rows)
        elif answer.document is not None:
            words = answer.document["next_experiment"]["excitation"]
        case = with_trial(case, volts, g)
        begun = time.perf_counter()
        answer = asked(case, case.truth["number"], judge)
        done.append(_round(case, answer, words) | {"seconds": time.perf_counter() - begun})
    return done


def with_trial(case: Case, volts: Volts, g: np.random.Generator) -> Case:
    """A case with one trial more, made on its rig."""
    motor, regulator = volts
    made = len(case.motor)
    (readings,) = measure(case.truth, motor[None], regulator[None], made, g)
    return replace(
        case,
        time=[*case.time, np.arange(len(motor)) / RATE],
        motor=[*case.motor, motor],
        regulator=[*case.regulator, regulator],
        readings=[*case.readings, readings],
    )


def _round(case: Case, answer: Answer, words: str) -> Round:
    said = "no answer"
    if answer.document is not None:
        said = compare(case.truth, answer.document).said
    hidden = [effect["name"] for effect in case.truth["effects"]]
    return {"excitation": words, "said": said, **judged(said, hidden)}
