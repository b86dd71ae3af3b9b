"""Trials that the report draws: driven once more, for a journal keeps figures and no motion."""

from functools import partial

from benchmarks.executors.executor import Executor, run_all
from benchmarks.runner.case import Case, drive
from benchmarks.runner.execution import PendingCases, identity
from benchmarks.suites.reproduction import ReproductionSuite
from pma_gym.data.trial import Trial

Pictured = dict[tuple[str, str, float], Trial]
"""Trials by controller, task and pressure (kPa)."""


def pictured_trials(
    suite: ReproductionSuite, todo: PendingCases, failed: set[str], executor: Executor
) -> Pictured:
    """The trials of a run that its report draws: the same bits as those that were scored.

    Args:
        suite: what was run.
        todo: its cases.
        failed: names of cases that have no trial.
        executor: where they are driven.
    Returns:
        The trials; one that cannot be driven again is left out.
    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    drawn = [c for c in todo.cases if suite.is_pictured(c.episode) and c.name not in failed]
    trials: dict[int, Trial] = {}

    def keep(index: int, result: object) -> None:
        if isinstance(result, Trial):
            trials[index] = result

    if not run_all([partial(_driven, case) for case in drawn], executor, keep):
        raise KeyboardInterrupt
    return {
        (name, episode.task, episode.pressure_kpa): trials[index]
        for index, case in enumerate(drawn)
        for name, episode in [identity(case)]
        if index in trials
    }


def _driven(case: Case) -> Trial:
    return drive(case)[0].trial
