"""Fit candidates beside the effects selected so far, with restarts from better parameters."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.probe_scores import Baseline
from pma_gym.discovery.screening.scanned_range import ScannedRange, scanned_range
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.screening.starting_points import starting_points
from pma_gym.discovery.selection.kept_fits import kept_form, restored
from pma_gym.discovery.thresholds import (
    COST,
    LEAST_FITTED,
    LEAST_GAIN,
    LEAST_KEPT,
    LIKELY,
    MOST_OF_IT,
    NOISE_LEFT,
    SAME_MINIMUM,
)
from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model

BEGUN, ALL_BEGUN = 2, 8
"""How many fits of a candidate are started, and how many where none came near the trials."""

BEST_SCANNED = 4
"""From how many values of that scan fits are begun."""


def cost(fit: Fitted) -> float:
    """Twice the negative log-likelihood, with what parameters cost."""
    return fit.chi_square + 2.0 * COST * len(fit.paths)


def carries_the_rest(problem: FitProblem, before: Fitted, gain: float) -> bool:
    """Whether a fall of chi-square is most of what a fit leaves, where it leaves much."""
    return problem.left(before) > NOISE_LEFT and gain > MOST_OF_IT * (
        before.chi_square - problem.count
    )


def starting_values(candidate: CandidateEffect, *fits: Fitted) -> np.ndarray:
    """Values of a candidate's parameters in the last of some fits that has it, else a probe."""
    for fit in reversed(fits):
        if candidate.effect in fit.model.parameters and candidate.name in fit.names:
            table = fit.model.values_in_files(candidate.effect)
            return np.array([table[path.partition(".")[2]] for path in candidate.paths], float)
    return candidate.probes[0]


def stripped(problem: FitProblem, before: Fitted) -> Model:
    """The given model with the parameters of a fit, without the effects that were added."""
    own = {path: float(before.values[before.paths.index(path)]) for path in problem.own.free}
    return problem.given.replace(own)


def probed(problem: FitProblem, before: Fitted, candidate: CandidateEffect) -> WhitenedResiduals:
    """Trials beside the model in which a candidate is looked for.

    It is without the effects that were added, whose changes add up, but for a candidate that only
    changes what those do.
    """
    through = CATALOGUE[candidate.effect].port in problem.given.rig.modifying_ports
    return problem.probed(before.model if through else stripped(problem, before), candidate)


def fitted(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    each: ScreeningScore,
    journal: Journal,
    caught: bool = False,
) -> Fitted | None:
    """The best of fits from the probes that explain most; of more where others were caught."""
    begun_at = f"{problem.noise} {before.names} {before.values.tolist()}"
    key = f"{begun_at} {each.candidate.name} {each.starts}{' caught' * caught}"
    extra = (*chosen, each.candidate)
    kept = journal.restored(key, lambda entry: restored(entry, problem, before, extra))
    if kept is not None:
        return kept
    best: Fitted | None = None
    whitened = probed(problem, before, each.candidate)
    for model, begun in _beginnings(problem, baseline, whitened, before, each, caught):
        fit = problem.fit(model, extra, {each.candidate.name: begun})
        if fit is not None and caught:
            fit = problem.continuation(fit, extra)
        alike = _alike(best, fit)
        if fit is not None and (best is None or fit.chi_square < best.chi_square):
            best = fit
        # As much as the look promised, or near at last: no other beginning is needed. Nor is one
        # where the last two ended alike. What did not converge says nothing of what others bring.
        if best is not None and (
            alike or not problem.far(best)
            if caught
            else best.converged and before.chi_square - best.chi_square >= each.gain
        ):
            break
    kept = 0.0 if best is None else before.chi_square - best.chi_square
    # Far from the trials a promise of less than two like fits differ by is not worth a scan.
    slight = problem.far(before) and each.gain < SAME_MINIMUM * before.chi_square
    if kept < LEAST_KEPT * each.gain and not slight:
        for begun in scanned_range(baseline, whitened, each).values[:BEST_SCANNED]:
            fit = problem.fit(before.model, extra, {each.candidate.name: begun})
            if fit is not None and (best is None or fit.chi_square < best.chi_square):
                best = fit
    if best is None or best.chi_square > before.chi_square:
        # A local minimum: without the effect the fit explains more.
        return None
    journal.keep(key, kept_form(best))
    return best


def _alike(one: Fitted | None, other: Fitted | None) -> bool:
    """Whether two fits ended at the same chi-square, as far as a choice of effects goes."""
    if one is None or other is None:
        return False
    return abs(one.chi_square - other.chi_square) < SAME_MINIMUM * min(
        one.chi_square, other.chi_square
    )


def _beginnings(
    problem: FitProblem,
    baseline: Baseline,
    whitened: WhitenedResiduals,
    before: Fitted,
    each: ScreeningScore,
    caught: bool,
) -> list[tuple[Model, np.ndarray]]:
    """Models and values of a candidate that fits begin from.

    Far from the trials the refitted parameters may stand in for what is missing: from the likeliest
    values a fit then begins at the parameters as they were given, too.
    """
    points = starting_points(baseline, whitened, each)[: ALL_BEGUN if caught else BEGUN]
    pairs = [(before.model, begun) for begun in points]
    if problem.far(before) and pairs:
        pairs.insert(0, (before.model.replace(_given(problem)), points[0]))
    return pairs


def _given(problem: FitProblem) -> dict[str, float]:
    """The model's own parameters as they were given, by path."""
    own = problem.own.free
    return dict(zip(own, values(problem.given, own).tolist(), strict=True))


def unfitted(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    scores: Sequence[ScreeningScore],
    fits: dict[str, Fitted],
) -> tuple[str, ...]:
    """Candidates whose fits explain far less than they could, which is more than any fit does.

    Args:
        problem: the trials.
        baseline: the model that they were tried beside, ready to be looked beside.
        before: the same.
        chosen: the effects in it.
        scores: of those that were fitted.
        fits: theirs, by name, as far as there are any.
    """
    gains = {name: before.chi_square - fit.chi_square for name, fit in fits.items()}
    most = max(gains.values(), default=0.0)

    def falls_short(score: ScreeningScore, promised: float) -> bool:
        return promised > most and gains.get(score.candidate.name, 0.0) < LEAST_FITTED * promised

    names = []
    for each in scores:
        if falls_short(each, each.gain):
            whitened = probed(problem, before, each.candidate)
            scan = scanned_range(baseline, whitened, each)
            kept = _kept_share(problem, before, chosen, each.candidate, scan)
            if kept >= LEAST_FITTED and falls_short(each, min(each.gain, scan.most)):
                names.append(each.candidate.name)
    return tuple(names)


def _kept_share(
    problem: FitProblem,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    candidate: CandidateEffect,
    scan: ScannedRange,
) -> float:
    """Which share of a promise a refit keeps beside the mildest value of a range.

    A promise lets the model's own parameters follow the candidate along straight lines. Beside a
    mild value a refit follows it to the end: what that does not keep is no failure of the
    candidate's fit, but the straight line's mistake. All of it where the refit cannot be simulated.
    """
    mildest = scan.mildest()
    if mildest is None:
        return 0.0
    held = replace(candidate, left=candidate.paths)
    values = dict(zip(candidate.paths, scan.values[mildest].tolist(), strict=True))
    refitted = problem.fit(held.beside(before.model).replace(values), (*chosen, held))
    if refitted is None:
        return 1.0
    return (before.chi_square - refitted.chi_square) / float(scan.promises[mildest])


def restarted(
    problem: FitProblem,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[CandidateEffect, ...],
    scores: Sequence[ScreeningScore],
    scored: Collection[str],
    fits: dict[str, Fitted],
    journal: Journal,
    progress: Callable[[str, int, int], None],
) -> dict[str, Fitted]:
    """Better fits, the likeliest first, until one comes near the trials; none where one has.

    Args:
        problem: the trials.
        baseline: the model that candidates were tried beside, ready to be looked beside.
        before: the same.
        chosen: the effects in it.
        scores: of the candidates.
        scored: names of those that were fitted because of their scores.
        fits: all fits so far, by name.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
    """
    known = {each.candidate.name: each for each in scores}
    better: dict[str, Fitted] = {}
    if not all(map(problem.far, fits.values())):
        return better
    most = max((known[name].gain for name in scored), default=0.0)
    likely = [name for name in scored if known[name].gain >= LIKELY * most]
    for number, name in enumerate(sorted(likely, key=lambda each: cost(fits[each]))):
        progress(f"fitting effect {len(chosen) + 1} from more beginnings", number, len(likely))
        restart = fitted(problem, baseline, before, chosen, known[name], journal, caught=True)
        if restart is not None and restart.chi_square < fits[name].chi_square:
            better[name] = restart
        if name in better and not problem.far(better[name]):
            break
    return better


def better(
    problem: FitProblem,
    fit: Fitted,
    chosen: tuple[CandidateEffect, ...],
    journal: Journal,
) -> Fitted:
    """A fit, or a better one from a careful search: what it misses would look like an effect.

    Args:
        problem: the trials.
        fit: the fit.
        chosen: the effects in it.
        journal: keeps fits.
    """

    def search() -> Fitted:
        refit = problem.careful_fit(fit.model.replace(_given(problem)), chosen)
        best = fit if refit is None or refit.chi_square >= fit.chi_square else refit
        return problem.continuation(best, chosen)

    return _once("better", problem, fit, chosen, journal, search)


def refit(
    problem: FitProblem,
    fit: Fitted,
    chosen: tuple[CandidateEffect, ...],
    journal: Journal,
    held: str = "",
) -> Fitted:
    """A fit, from where it is, beside the noise that the bench has now.

    Args:
        problem: the trials.
        fit: where it begins; the result where no better one can be made.
        chosen: the effects in it.
        journal: keeps fits.
        held: what its model holds beside the values of the fit, for the journal.
    """
    what = f"again {held}".strip()

    def search() -> Fitted:
        return problem.until_converged(problem.fit(fit.model, chosen) or fit, chosen)

    return _once(what, problem, fit, chosen, journal, search)


def _once(
    what: str,
    problem: FitProblem,
    fit: Fitted,
    chosen: tuple[CandidateEffect, ...],
    journal: Journal,
    search: Callable[[], Fitted],
) -> Fitted:
    """What a search from a fit found, from the journal where it was made before."""
    key = f"{what} {problem.noise} {fit.names} {fit.values.tolist()}"
    kept = journal.restored(key, lambda entry: restored(entry, problem, fit, chosen))
    if kept is not None:
        return kept
    searched = search()
    journal.keep(key, kept_form(searched))
    return searched


def without_absent(
    problem: FitProblem, fit: Fitted, chosen: tuple[CandidateEffect, ...]
) -> tuple[tuple[CandidateEffect, ...], Fitted]:
    """The effects less those whose sizes a fit ended with at nothing, and the fit of the others."""
    others = tuple(each for each in chosen if not each.is_absent(fit.model))
    if len(others) == len(chosen) or not others:
        return chosen, fit
    # What the model had when it was given stays in it.
    stay = {each.effect for each in others} | problem.given.parameters.keys()
    names = {each.effect for each in chosen} - stay
    kept = {name: table for name, table in fit.model.parameters.items() if name not in names}
    less = replace(fit.model, parameters=kept)
    refitted = problem.fit(less, others)
    return (chosen, fit) if refitted is None else (others, replace(refitted, spread=fit.spread))


def without_idle(
    problem: FitProblem,
    best: Fitted,
    chosen: tuple[CandidateEffect, ...],
    refitted: Fitted,
    journal: Journal,
) -> tuple[tuple[CandidateEffect, ...], Fitted]:
    """The effects less those that nobody misses, and the fit of those that stay."""
    worst = refitted.chi_square
    for candidate in chosen:
        others = tuple(each for each in chosen if each is not candidate)
        begun = stripped(problem, best)
        starts = {
            each.name: np.array(
                [best.model.values_in_files(p.split(".")[0])[p.split(".")[1]] for p in each.paths],
                float,
            )
            for each in others
        }
        without = problem.fit(begun, others, starts)
        if without is None:
            continue
        missed = without.chi_square - best.chi_square
        least = 0.02 * max(worst - best.chi_square, 0.0)
        law = CATALOGUE[candidate.effect]
        if any(law.is_further_term(CATALOGUE[each.effect]) for each in others):
            # What it explains is no error of the other's law.
            least = 0.0
        idle = missed < max(LEAST_GAIN, least)
        if idle and not carries_the_rest(problem, without, missed):
            return others, refit(problem, without, others, journal)
    return chosen, best
