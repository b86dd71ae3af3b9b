"""Another effect in place of a term of one: a friction that falls with speed, or a quadratic drag.

A law with a further term explains some of what an effect beside it would, and the look beside the
whole law sees nothing left. So where the search ends, looks are taken beside the law without its
term too.
"""

from collections.abc import Callable, Sequence

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.selection.candidate_fits import cost
from pma_gym.discovery.selection.stages import Stage, stage_of
from pma_gym.discovery.selection.tied_laws import Chosen, Nested, fit_tied, simpler_laws
from pma_gym.discovery.selection.tried_candidates import Progress


def instead_of_term(
    problem: FitProblem,
    fit: Fitted,
    chosen: Chosen,
    rest: Sequence[CandidateEffect],
    seed: int,
    journal: Journal,
    progress: Progress,
    is_worth: Callable[[Stage, float], bool],
) -> tuple[Stage, Chosen, Fitted] | None:
    """An effect that explains more beside a law without its term than the term does.

    Args:
        problem: the trials.
        fit: the fit of the effects.
        chosen: the effects.
        rest: the other candidates.
        seed: of simulated residuals.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
        is_worth: whether an effect is worth adding in a round, by what it brings of chi-square.
    Returns:
        The round beside the law without its term, the effects and their fit; None where no effect
        has a term, or nothing that is worth it explains more.
    """
    state, least, best = Nested(chosen, fit, {}), cost(fit), None
    known = {candidate.name: candidate for candidate in rest}
    for place, candidate in enumerate(chosen):
        for tie in simpler_laws(candidate):
            simpler = None if tie.twin else fit_tied(problem, state, place, tie)
            if simpler is None:
                continue
            stage = stage_of(problem, simpler.fit, simpler.chosen, rest, seed, journal, progress)
            for name, other in stage.fits.items():
                gain = stage.before.chi_square - other.chi_square
                if cost(other) < least and is_worth(stage, gain):
                    least, best = cost(other), (stage, known[name], other)
    if best is None:
        return None
    stage, new, other = best
    # The term may still be there beside it: nested laws ask that.
    whole = problem.fit(other.model, (*chosen, new))
    return None if whole is None else (stage, (*chosen, new), whole)
