"""What the reader of a diagnosis must know first."""

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.answer.own_parameters import doubts
from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.fitting.fit_problem import FitProblem, Fitted
from pma_gym.discovery.fitting.free_parameters import unit
from pma_gym.discovery.preparation.acceptance_floors import NOISE
from pma_gym.discovery.report.approximate_text import why_approximate
from pma_gym.discovery.report.figure_text import figure
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.unknown import Reason
from pma_gym.units import SI_FACTORS, with_unit


def reader_warnings(findings: Findings) -> tuple[str, ...]:
    """Doubts, widened ranges, refits that were discarded or did not converge, a lone trial."""
    words = [*doubts(findings), *widened_ranges(findings.problem, findings.proposed[1])]
    words += fine_tolerances(findings)
    if findings.discarded is not None:
        given, refitted = findings.discarded
        words.append(
            f"a refit was discarded: it raises the whitened sum of squares of the readings that it "
            f"was fitted to, from {given:.5g} to {refitted:.5g}"
        )
    if not findings.proposed[1].converged:
        words.append("the last fit stopped before it had converged; its intervals are rough")
    if findings.unseen is None:
        words.append(
            "with one trial nothing can be left out: the gap after the amendment is that of the "
            "data it was fitted to"
        )
    return tuple(words)


def fine_tolerances(findings: Findings) -> list[str]:
    """A sentence on each tolerance that is finer than the readings' noise."""
    said = []
    for name, each in findings.adequacy.signals.items():
        if each.floor is not None and each.floor.source == NOISE and each.floor.tolerance:
            column = BY_QUANTITY[name]
            factor = SI_FACTORS[column.unit]
            said.append(
                f"{column.name}: the tolerance of {figure(each.floor.tolerance / factor)} "
                f"{column.unit} is finer than the readings' noise of "
                f"{figure(each.floor.level / factor)} {column.unit}, and no model comes closer to "
                "readings than that: the noise is the limit"
            )
    return said


def approximate_law_warnings(verdict: Verdict, unknown: Reason | None) -> list[str]:
    """Why the law of what is named is only approximate."""
    return [why_approximate(unknown)] if verdict == "effect" and unknown is not None else []


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
