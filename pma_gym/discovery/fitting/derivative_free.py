"""Refine a fit without derivatives, where chi-square is rugged.

Stick and slip come at other instants when a parameter changes a little. Chi-square then has many
small minima, narrower than the move that a derivative is taken with, and Levenberg-Marquardt stops
at any of them. The simplex of Nelder and Mead compares values only. It begins several standard
errors wide, wider than the ruggedness, and shrinks to a minimum.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

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

LEAST_GAIN = 0.01
"""Share of chi-square by which a further simplex must lower it, or it found nothing new."""

IMPOSSIBLE = 1e300
"""Chi-square where the model cannot be simulated."""


def refined(problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect]) -> Fitted:
    """Refine a fit by simplices until a further one gains nothing.

    Args:
        problem: the trials.
        fit: where the first simplex begins.
        chosen: the effects in it.
    Returns:
        The fit, of no larger chi-square; converged where the last simplex gained nothing.
    """
    best, converged = fit, False
    for _ in range(SIMPLICES):
        before, (best, shrunk) = best, _by_simplex(problem, best, chosen)
        gain = before.chi_square - best.chi_square
        converged = shrunk and gain < LEAST_GAIN * before.chi_square
        if converged:
            break
    return replace(best, converged=converged)


def _by_simplex(
    problem: FitProblem, fit: Fitted, chosen: Sequence[CandidateEffect]
) -> tuple[Fitted, bool]:
    """The least that one simplex reaches from a fit, and whether it shrank to it."""
    whitened = problem.whitened_at(fit, chosen)
    # Derivatives over moves that show as much as the residual: shorter ones see the ruggedness.
    left = max(1.0, problem.left(fit))
    steps = np.where(fit.values + left * fit.steps > whitened.upper, -left, left) * fit.steps
    curvature = whitened.sums(fit.values, steps).curvature
    if not np.isfinite(curvature).all():
        return fit, False
    local = replace(fit, covariance=inverse(curvature), steps=np.abs(steps))
    axes = WIDTH * left * covariance_root(local)
    least, most = whitened.lower, whitened.upper

    def at(moves: np.ndarray) -> np.ndarray:
        return np.clip(fit.values + axes @ moves, least, most)

    def chi_square(moves: np.ndarray) -> float:
        sums = whitened.sums(at(moves), np.empty(0))
        return min(sums.chi_square, IMPOSSIBLE)

    size = len(fit.values)
    ended = minimize(
        chi_square,
        np.zeros(size),
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([np.zeros(size), np.eye(size)]),
            "maxfev": EVALUATIONS * size,
            "xatol": NARROW,
            "fatol": left**2,
            "adaptive": True,
        },
    )
    if not ended.fun < fit.chi_square:
        return fit, bool(ended.success)
    reached = at(ended.x)
    model = fit.model.replace(dict(zip(fit.paths, reached.tolist(), strict=True)))
    moved = replace(local, model=model, values=reached, chi_square=float(ended.fun))
    return replace(moved, steps=fit.steps), bool(ended.success)
