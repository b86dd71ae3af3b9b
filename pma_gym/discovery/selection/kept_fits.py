"""Fits as a journal keeps them, and made again from there."""

from collections.abc import Sequence

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.document_shape import ANY, ListOf, Real, check_shape

_KEPT = {
    "paths": ListOf(str),
    "values": ListOf(Real()),
    "covariance": ListOf(ListOf(Real(finite=False))),
    "chi_square": Real(),
    "steps": ListOf(Real(finite=False)),
    "converged": bool,
    "reach": {ANY: Real(1.0)},
    "spread": {ANY: ListOf(Real())},
}
"""Shape of a fit in a journal."""


def kept_form(fit: Fitted) -> dict:
    """A fit as a journal keeps it."""
    return {
        "paths": list(fit.paths),
        "values": fit.values.tolist(),
        "covariance": fit.covariance.tolist(),
        "chi_square": fit.chi_square,
        "steps": fit.steps.tolist(),
        "converged": bool(fit.converged),
        "reach": dict(fit.reach),
        "spread": {path: list(ends) for path, ends in fit.spread.items()},
    }


def restored(
    kept: dict, problem: FitProblem, before: Fitted, extra: Sequence[CandidateEffect]
) -> Fitted:
    """A fit from a journal.

    Raises:
        ValueError: an entry of another form, or of other parameters.
    """
    check_shape(kept, _KEPT)
    count = len(kept["paths"])
    wanted = [*problem.own.free, *(path for each in extra for path in each.fitted_paths)]
    shapes = (len(kept["values"]), len(kept["steps"]), np.shape(kept["covariance"]))
    if shapes != (count, count, (count, count)) or kept["paths"] != wanted:
        raise ValueError(f"it has {shapes} numbers of {count} parameters")
    model = before.model
    for candidate in extra:
        model = candidate.beside(model)
        switched = {
            path: float(value)
            for path, value, free in zip(
                candidate.paths, candidate.probes[0], candidate.fitted, strict=True
            )
            if not free
        }
        model = model.replace(switched) if switched else model
    by_path = dict(zip(kept["paths"], kept["values"], strict=True))
    return Fitted(
        model.replace(by_path),
        tuple(candidate.name for candidate in extra),
        tuple(kept["paths"]),
        np.array(kept["values"]),
        np.array(kept["covariance"]),
        kept["chi_square"],
        np.array(kept["steps"]),
        kept["converged"],
        kept["reach"],
        {path: (min(ends), max(ends)) for path, ends in kept["spread"].items()},
    )
