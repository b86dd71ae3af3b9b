"""What a fit says of ranges that were assumed beforehand and that it went beyond."""

from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import unit
from pma_gym.discovery.report.text import figure
from pma_gym.units import with_unit


def widened_ranges(problem: FitProblem, fit: Fitted) -> list[str]:
    """A sentence for each parameter of a fit that lies beyond what was assumed of it."""
    whitened, said = problem.whitened_residuals(problem.given), []
    rows = zip(whitened.free, whitened.lower, whitened.upper, strict=True)
    for path, low, high in ((free.path, low, high) for free, low, high in rows):
        value = dict(zip(fit.paths, fit.values.tolist(), strict=True)).get(path, low)
        if low <= value <= high:
            continue
        kept = f"{figure(low)} to {with_unit(figure(high), unit(path))}"
        said.append(
            f"{path}: {with_unit(figure(value), unit(path))} lies beyond what is assumed "
            f"beforehand ({kept}); its range was widened {fit.reach.get(path, 1.0):g} times, as "
            "long as the fit gained by it"
        )
    return said
