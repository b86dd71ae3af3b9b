"""What trials that nobody measured yet would tell: those of excitations, simulated by a model."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.discovery.experiments.excitation import Excitation
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.thresholds import MOST_LOG_ODDS
from pma_gym.plant.model import Model

Array = NDArray[np.float64]
Columns = NDArray[np.float32]


def predicted(
    problem: FitProblem, model: Model, free: Sequence[str], *simulated: Trial
) -> WhitenedResiduals:
    """Simulated trials beside a model."""
    nothing = np.full(len(free), np.inf)
    trials = [as_measured(problem, trial) for trial in simulated]
    return WhitenedResiduals(model, trials, free, problem.noise, nothing, threads=problem.threads)


def columns(
    problem: FitProblem, model: Model, free: Sequence[str], simulated: Sequence[Trial], tried: Array
) -> list[Columns | None]:
    """`Evidence.columns` of each simulated trial, None for one that has none.

    All at once, which takes a fraction of the time; one by one where one of them spoils that.
    """
    if not simulated:
        return []
    together = predicted(problem, model, free, *simulated).columns(tried)
    if together is not None:
        return list(together)
    apart = [predicted(problem, model, free, trial).columns(tried) for trial in simulated]
    return [None if each is None else each[0] for each in apart]


def derivatives(
    problem: FitProblem,
    model: Model,
    fit: Fitted,
    simulated: Sequence[Trial],
    which: Sequence[int] | NDArray[np.int64] | None = None,
) -> list[Array | None]:
    """Derivatives of the whitened readings of each trial, shape (p, 4 rows); None if it has none.

    Args:
        problem: says what a lab measures, and its noise.
        model: the fit's, as a new trial would see it.
        fit: where, and how far parameters are moved for it.
        simulated: the trials.
        which: by which parameters; all if not given.
    """
    chosen = np.arange(len(fit.values)) if which is None else np.asarray(which)
    steps = fit.steps[chosen]
    moved = np.concatenate([fit.values[None], fit.values + np.diag(fit.steps)[chosen]])
    parts = columns(problem, model, fit.paths, simulated, moved)
    return [None if each is None else _per_step(each, steps) for each in parts]


def _per_step(trial_columns: Columns, steps: Array) -> Array:
    changes = trial_columns[1:].astype(np.float64)
    return changes.reshape(len(steps), -1) / steps[:, None]


def as_measured(problem: FitProblem, simulated: Trial) -> Trial:
    """A simulated trial with the signals that the lab measures."""
    known = {name for trial in problem.trials for name in _measured(trial)}
    readings = {name: row for name, row in simulated.measurements.items() if name in known}
    return replace(simulated, measurements=readings, truth={})


def _measured(trial: Trial) -> Iterator[str]:
    for name, row in trial.measurements.items():
        if np.isfinite(row).any():
            yield name


def proposal(excitation: Excitation, separates: Sequence[str], log_odds: float) -> NextExperiment:
    """An excitation as an experiment to propose.

    Args:
        excitation: its name and commands.
        separates: names of what it tells apart.
        log_odds: natural logarithm of the odds to expect; no more than `MOST_LOG_ODDS` is promised.
    """
    odds = math.exp(min(log_odds, MOST_LOG_ODDS))
    note = {"note": f"proposed: {excitation.name}"}
    trial = Trial(excitation.trial.time, excitation.trial.commands, provenance=note)
    return NextExperiment(excitation.name, tuple(separates), odds, excitation.minutes, trial)
