"""Tables that took no part: the dissertation's own voltages on a model, beside tables 21-30."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.reproduction.replay import ReplayError, all_replay_errors, summarise
from benchmarks.reproduction.results import Results, scores_of
from benchmarks.runner.case import cases, run_case
from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.frozen import load_suite
from benchmarks.suites.reproduction import ReproductionSuite

PHASE_NAMES = {
    "displacement": "displacement (tables 21, 22)",
    "I": "rotation I (tables 27, 30)",
    "II": "rotation II (tables 28, 30)",
    "III": "rotation III (tables 29, 30)",
}
"""Phases in words, with the tables that they are held against."""


@dataclass(frozen=True)
class Replay:
    """Difference of a model's replay from the measured trial in one phase.

    Attributes:
        task: displacement or rotation.
        phase: of it.
        slope: mean absolute error of the slope (mm/s or deg/s).
        intercept: of the intercept (mm or deg).
        mean: of the mean position (mm or deg).
        mean_signed: mean error of the mean position (mm or deg).
        rmse: mean absolute difference of the RMSE (mm or deg).
        trials: how many trials.
        errors: each trial's.
    """

    task: str
    phase: str
    slope: float
    intercept: float
    mean: float
    mean_signed: float
    rmse: float
    trials: int
    errors: tuple[ReplayError, ...] = ()


def replays(model: Path | str, suite: ReproductionSuite | None = None) -> list[Replay]:
    """Replay the printed voltages on a model, open loop.

    Args:
        model: a shipped name, or a TOML file.
        suite: what is run; all trials of the reproduction if not given.
    Returns:
        One a phase; a trial that the model cannot be driven through is left out.
    """
    suite = suite or load_suite()
    suite = suite.select([str(model)], [_replay(suite)])
    rows = [run_case(case) for case in cases(suite, suite.entries)]
    results = Results(suite, scores_of(suite, rows))
    return [
        _summary(task, phase, errors)
        for (task, phase), errors in all_replay_errors(results, str(model)).items()
    ]


def _replay(suite: ReproductionSuite) -> ControllerSpec:
    return next(each for each in suite.controllers if each.name == suite.goals.replay)


def _summary(task: str, phase: str, errors: Sequence[ReplayError]) -> Replay:
    summary = summarise(errors)
    absolute: Mapping[str, float] = summary.absolute
    return Replay(
        task,
        phase,
        absolute["slope"],
        absolute["intercept"],
        absolute["mean"],
        summary.signed["mean"],
        absolute["rmse"],
        summary.trials,
        tuple(errors),
    )
