"""Every effect of the catalogue with its gain, and why it was kept or dropped."""

from collections.abc import Mapping

from pma_gym.discovery.result.candidate import ADDED, UNFITTED, Candidate
from pma_gym.discovery.screening.score_test import ScreeningScore
from pma_gym.discovery.selection.stages import passes
from pma_gym.discovery.verdict.findings import Findings


def candidate_list(findings: Findings) -> tuple[Candidate, ...]:
    """The whole catalogue, what was added first, then by what each could explain."""
    if not findings.selection.stages:
        return ()
    stage = findings.selection.stages[0]
    chosen = [candidate.name for candidate in findings.selection.chosen]
    gains = _held_out_gains(findings)
    listed = []
    for each in stage.scores:
        name = each.candidate.name
        fit = stage.fits.get(name)
        gain = each.gain if fit is None else stage.before.chi_square - fit.chi_square
        candidate = Candidate(
            name=name,
            delta_log_likelihood=0.5 * gain,
            held_out_gain=gains.get(name),
            p_value=each.p_value,
            change=each.change,
            resolvable=each.resolvable,
            fitted=fit is not None,
            why=_why(findings, each, name in chosen),
        )
        listed.append(candidate)
    return tuple(
        sorted(listed, key=lambda c: (c.name not in chosen, not c.fitted, -c.delta_log_likelihood))
    )


def _why(findings: Findings, score: ScreeningScore, chosen: bool) -> str:
    name = score.candidate.name
    if chosen:
        return ADDED
    for candidate, rivals in zip(findings.selection.chosen, findings.rivals, strict=True):
        for rival in rivals:
            if rival.candidate.name == name:
                if rival.equal:
                    return f"explains these data as well as {candidate.name}"
                return (
                    f"explains less than {candidate.name}, by a log-likelihood of "
                    f"{rival.behind / 2:.4g}"
                )
    if name in findings.selection.stages[-1].unfitted:
        return UNFITTED
    if score.resolvable is None:
        return "these data could not show it at any size"
    if not passes(findings.problem, score):
        if score.resolvable > 1.0:
            return f"would show from {score.resolvable:.2g} times its usual size on only"
        return "explains no more than chance would"
    return "explains less than what was added"


def _held_out_gains(findings: Findings) -> Mapping[str, float]:
    """Gain in log-likelihood a reading on trials left out, for what was added."""
    if findings.unseen is None or findings.unseen_without is None or not findings.selection.chosen:
        return {}
    gain = findings.unseen_without.chi_square.sum() - findings.unseen.chi_square.sum()
    count = sum(
        logged.count for logged in findings.problem.whitened_residuals(findings.given).logged
    )
    return {candidate.name: float(0.5 * gain / count) for candidate in findings.selection.chosen}
