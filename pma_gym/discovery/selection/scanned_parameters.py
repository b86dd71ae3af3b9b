"""Held parameters that differ from rig to rig by powers of ten: the best of a ladder is held.

How far a contact deflects before it slips decides how a rig starts to move, and chi-square is too
rugged in it for a fit. A rolling guide deflects by a micrometre, a seal by a tenth of a millimetre.
So the effects that have such a parameter are fitted again at a tenth and at ten times its value,
and on in the direction in which the trials ask for it.

A shorter distance before it slips is the simpler law. What friction does at a reversal changes with
the square root of the distance, so that a rung where chi-square is as good as flat still moves the
other parameters by their errors: a share of friction was 6.0 % at 0.02 um, 6.2 % at 0.0001. So the
rigid end of the ladder is tried at last, and stays unless the rung explains more than chance.
"""

from dataclasses import replace

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import values
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.selection.candidate_fits import refit
from pma_gym.discovery.thresholds import COST
from pma_gym.effects import CATALOGUE

LADDER = (10.0, 10.0**0.5)
"""Steps of the ladder: decades first, then half of one beside the best."""

ROUNDED = 1.0 + 1e-9
"""How much within its bounds a value stays."""

RIGID = 1.01
"""The rigid end, as a multiple of the lower bound: within it, whatever the rounding."""

MOST_STEPS = 100.0
"""Most steps of the integrator from one reading to the next. A contact that takes more rings faster
than any reading shows, and each of its fits takes minutes: a log of five seconds at 500 Hz had no
answer after fifteen."""

RIGID_STEPS = 10.0
"""Most steps from one reading to the next at the rigid end. A contact that sticks takes more there:
it swings on its bristles."""

Chosen = tuple[CandidateEffect, ...]


def with_scanned(
    problem: FitProblem,
    fit: Fitted,
    chosen: Chosen,
    journal: Journal,
    ends_rigid: bool = False,
) -> tuple[Chosen, Fitted]:
    """The effects and their fit, with scanned parameters at the best of their ladders.

    Args:
        problem: the trials.
        fit: the fit of the effects.
        chosen: the effects in it.
        journal: keeps fits.
        ends_rigid: whether the rigid end is tried at last: of a fit that no effect is added to any
            more, for far from the trials it leads to other minima.
    """
    for name in [candidate.name for candidate in chosen]:
        candidate = next(each for each in chosen if each.name == name)
        for path in _scanned(candidate):
            for step in LADDER:
                for factor in (1.0 / step, step):
                    chosen, fit = _climbed(problem, fit, chosen, name, path, factor, journal)
            if ends_rigid and not problem.far(fit):
                chosen, fit = _rigid(problem, fit, chosen, name, path, journal)
    return chosen, fit


def _scanned(candidate: CandidateEffect) -> list[str]:
    """Paths of the held parameters that are scanned."""
    effect = CATALOGUE[candidate.effect]
    stems = effect.names_in_files()
    return [f"{effect.name}.{key}" for key, stem in stems.items() if stem in effect.scanned]


def _climbed(
    problem: FitProblem,
    fit: Fitted,
    chosen: Chosen,
    name: str,
    path: str,
    factor: float,
    journal: Journal,
) -> tuple[Chosen, Fitted]:
    """On along a ladder in one direction, as long as each step is worth a parameter."""
    while True:
        here = float(values(fit.model, [path])[0])
        (lower,), (upper,) = bounds([path])
        there = factor * here
        # A bound that is converted to SI and back may lie beyond itself.
        if not lower * ROUNDED < there < upper / ROUNDED:
            return chosen, fit
        moved = tuple(_at(each, path, there) if each.name == name else each for each in chosen)
        begun = replace(fit, model=fit.model.replace({path: there}))
        if factor < 1.0 and problem.steps_a_row(begun.model, moved) > MOST_STEPS:
            return chosen, fit
        new = refit(problem, begun, moved, journal, f"{path} {there}")
        worth = 2.0 * COST * max(1.0, problem.left(fit) ** 2)
        if fit.chi_square - new.chi_square < worth:
            return chosen, fit
        chosen, fit = moved, new


def _rigid(
    problem: FitProblem, fit: Fitted, chosen: Chosen, name: str, path: str, journal: Journal
) -> tuple[Chosen, Fitted]:
    """At the rigid end of a ladder, where the rung explains no more than a parameter is worth."""
    (lower,), _ = bounds([path])
    there = lower * RIGID
    if not there < float(values(fit.model, [path])[0]):
        return chosen, fit
    moved = tuple(_at(each, path, there) if each.name == name else each for each in chosen)
    begun = replace(fit, model=fit.model.replace({path: there}))
    if problem.steps_a_row(begun.model, moved) > min(RIGID_STEPS, MOST_STEPS):
        return chosen, fit
    new = refit(problem, begun, moved, journal, f"{path} {there}")
    as_good = new.converged and new.chi_square < fit.chi_square + 2.0 * COST
    return (moved, new) if as_good else (chosen, fit)


def _at(candidate: CandidateEffect, path: str, value: float) -> CandidateEffect:
    """A candidate with a held parameter at another value (file unit)."""
    return replace(candidate, model=candidate.model.replace({path: value}))
