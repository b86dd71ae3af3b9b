"""The experiment after trials that cannot show some effects: where most of those would show."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.experiments.excitation import Excitation, library
from pma_gym.discovery.experiments.predicted_trials import Columns, columns, derivatives, proposal
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.predictive_density import unabsorbed
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.thresholds import SHOWN_GAIN, SMALLEST_SIZE
from pma_gym.effects import CATALOGUE

Array = NDArray[np.float64]


def experiment_to_detect(
    problem: FitProblem,
    fit: Fitted,
    candidates: Sequence[CandidateEffect],
    scores: Sequence[ScreeningScore],
    seed: int = 0,
) -> NextExperiment | None:
    """The excitation in which most would show of what these trials cannot show.

    How large an effect is if it is there nobody knows: any size from a tenth of the usual one to
    that counts as equally likely, in proportion. The best one makes the most effects show that
    would not have shown by now, on average; among equals the shortest.

    Args:
        problem: the trials so far.
        fit: the refitted model, without any candidate that is looked for.
        candidates: those that would be worth seeing.
        scores: at them in the trials so far, which say from what size on they would have been seen.
        seed: of what is random in excitations.
    Returns:
        What to measure next; None where every effect would have been seen at its usual size, or no
        excitation would show one that would not.
    """
    known = {each.candidate.name: each for each in scores}
    wanted = [candidate for candidate in candidates if candidate.name in known]
    hidden = np.array([not _was_visible(known[candidate.name]) for candidate in wanted], bool)
    if not hidden.any():
        return None
    before = np.array([_strength(known[candidate.name]) for candidate in wanted])
    pairs = [(candidate, _usual(candidate)) for candidate in wanted]
    best: tuple[tuple[float, float], Excitation, Array] | None = None
    excitations = list(library([fit.model, problem.given], seed))
    for excitation, gains in zip(
        excitations, _shown(problem, fit, excitations, pairs), strict=True
    ):
        new = float(np.sum(chance_to_show(before + gains) - chance_to_show(before)))
        rank = round(new, 6), -excitation.minutes
        if (hidden & (gains >= SHOWN_GAIN)).any() and (best is None or rank > best[0]):
            best = rank, excitation, gains
    if best is None:
        return None
    seen = hidden & (best[2] >= SHOWN_GAIN)
    names = [candidate.name for candidate, shows in zip(wanted, seen, strict=True) if shows]
    return proposal(best[1], names, 0.5 * float(np.min(best[2][seen])))


def chance_to_show(gains: Array) -> Array:
    """Chance that effects show which are as large as usual, or down to a tenth of that.

    Args:
        gains: chi-square that each gains at its usual size, shape (k,); it goes with the square of
            the size.
    """
    share = np.sqrt(SHOWN_GAIN / np.maximum(gains, 1e-12))
    return np.clip(np.log(share) / np.log(SMALLEST_SIZE), 0.0, 1.0)


def _strength(each: ScreeningScore) -> float:
    """Chi-square that an effect of usual size would have gained in the trials so far."""
    return SHOWN_GAIN / each.resolvable**2 if each.resolvable else 0.0


def _was_visible(each: ScreeningScore) -> bool:
    return each.resolvable is not None and each.resolvable <= 1.0


def _shown(
    problem: FitProblem,
    fit: Fitted,
    excitations: Sequence[Excitation],
    hidden: Sequence[tuple[CandidateEffect, Array]],
) -> Array:
    """Chi-square that hidden candidates of usual size would gain in excitations, shape (n, k)."""
    trials = [excitation.simulated[0] for excitation in excitations]
    grown = list[list[Columns | None]]()
    for candidate, usual in hidden:
        model, tried = candidate.beside(fit.model), np.stack([candidate.absent, usual])
        grown.append(columns(problem, model, candidate.paths, trials, tried))
    distances = np.zeros((len(excitations), len(hidden)))
    for k, by in enumerate(derivatives(problem, fit.model, fit, trials)):
        if by is None:
            continue
        changes = np.zeros((len(hidden), by.shape[1]))
        for row, each in zip(changes, grown, strict=True):
            one = each[k]
            if one is not None:
                row[:] = one[1].ravel()
        distances[k] = unabsorbed(changes, by, fit)
    return distances


def _usual(candidate: CandidateEffect) -> Array:
    """Values of a candidate's parameters at its usual size, in file units."""
    usual_values = []
    for path in candidate.paths:
        effect, _, file_key = path.partition(".")
        law = CATALOGUE[effect]
        usual_values.append(law.quantities[law.names_in_files()[file_key]].usual)
    absent = zip(usual_values, candidate.absent, strict=True)
    usual = np.array([other if value is None else value for value, other in absent], float)
    if np.array_equal(usual, candidate.absent):
        # A sensor whose usual bandwidth is what the model says: a slower one.
        return candidate.probes[len(candidate.probes) // 2]
    return np.clip(usual, *bounds(candidate.paths))
