"""Refine a fit without derivatives, where chi-square is rugged.

Stick and slip come at other instants when a parameter changes a little. Chi-square then has many
small minima, narrower than the move that a derivative is taken with, and Levenberg-Marquardt stops
at any of them. The simplex of Nelder and Mead compares values only. It begins several standard
errors wide, wider than the ruggedness, and shrinks to a minimum.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.predictive_density import covariance_root
from pma_gym.estimation.least_squares import inverse

WIDTH = 3.0
"""Edges of the first simplex, in standard errors."""

NARROW = 0.02
"""Size of the last simplex, as a share of the first."""

EVALUATIONS = 50
"""Most simulations of one simplex, for each parameter."""

SIMPLICES = 5
"""Most simplices, each begun where the one before it ended."""

MOST_STEPS = 100_000_000
"""Steps of the integrator after which no simplex goes on, about twenty seconds of one core: one of
a stiff contact would take minutes. The fit then has not converged, and the answer says so."""

NARROWER = 0.25
"""Size of a simplex over that of one that gained nothing: the same again would end the same."""

LEAST_GAIN = 0.01
"""Share of chi-square by which a further simplex must lower it, or it found nothing new."""

IMPOSSIBLE = 1e300
"""Chi-square where the model cannot be simulated."""


def refined(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect], narrows: bool = False
) -> Fitted:
    """Refine a fit by simplices until a further one gains nothing.

    Args:
        problem: the trials.
        fit: where the first simplex begins.
        chosen: the effects in it.
        narrows: whether a simplex that gains nothing is followed by a narrower one, in place of
            being the last.
    Returns:
        The fit, of no larger chi-square; converged where the last simplex gained nothing.
    """
    best, converged, size, left = fit, False, 1.0, MOST_STEPS
    for _ in range(SIMPLICES):
        ended = _by_simplex(problem, best, chosen, size, left)
        gain, before = best.chi_square - ended.fit.chi_square, best
        best, left = ended.fit, left - ended.steps
        converged = ended.shrunk and gain < LEAST_GAIN * before.chi_square
        if converged or left <= 0 or not (narrows or gain > 0.0):
            break
        size = 1.0 if gain > 0.0 else NARROWER * size
    return replace(best, converged=converged)


@dataclass(frozen=True)
class _Ended:
    """The least that a simplex reached, whether it shrank to it, and the integrator's steps."""

    fit: Fitted
    shrunk: bool
    steps: int


def _by_simplex(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect], size: float, most: int
) -> _Ended:
    """What one simplex of a size (1: usual) reaches within so many steps of the integrator."""
    whitened = problem.whitened_at(fit, chosen)
    # Derivatives over moves that show as much as the residual: shorter ones see the ruggedness.
    left = max(1.0, problem.left(fit))
    steps = np.where(fit.values + left * fit.steps > whitened.upper, -left, left) * fit.steps
    curvature = whitened.sums(fit.values, steps).curvature
    if not np.isfinite(curvature).all():
        return _Ended(fit, False, whitened.attempts)
    local = replace(fit, covariance=inverse(curvature), steps=np.abs(steps))
    axes = WIDTH * left * covariance_root(local)

    def at(moves: np.ndarray) -> np.ndarray:
        return np.clip(fit.values + axes @ moves, whitened.lower, whitened.upper)

    def stop_late(intermediate_result: OptimizeResult) -> None:
        if whitened.attempts > most:
            raise StopIteration

    def chi_square(moves: np.ndarray) -> float:
        sums = whitened.sums(at(moves), np.empty(0))
        return min(sums.chi_square, IMPOSSIBLE)

    count = len(fit.values)
    ended = minimize(
        chi_square,
        np.zeros(count),
        method="Nelder-Mead",
        callback=stop_late,
        options={
            "initial_simplex": np.vstack([np.zeros(count), size * np.eye(count)]),
            "maxfev": EVALUATIONS * count,
            "xatol": NARROW,
            "fatol": left**2,
            "adaptive": True,
        },
    )
    if not ended.fun < fit.chi_square:
        return _Ended(fit, bool(ended.success), whitened.attempts)
    reached = at(ended.x)
    model = fit.model.replace(dict(zip(fit.paths, reached.tolist(), strict=True)))
    moved = replace(local, model=model, values=reached, chi_square=float(ended.fun))
    return _Ended(replace(moved, steps=fit.steps), bool(ended.success), whitened.attempts)
