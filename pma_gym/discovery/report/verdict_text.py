"""A diagnosis in sentences: its verdict, what was done, and why a parameter is not determined."""

import numpy as np

from pma_gym.discovery.diagnosis import Diagnosis, Verdict
from pma_gym.discovery.fitting.fit_problem import Fitted
from pma_gym.discovery.fitting.free_parameters import FreeParameters, unit
from pma_gym.discovery.report.adequacy_text import agreement, remainder, undecided
from pma_gym.discovery.report.approximate_text import left_text
from pma_gym.discovery.report.effect_text import effect_name, effect_names
from pma_gym.discovery.report.figure_text import (
    at_its_limit,
    chance,
    distinct,
    figure,
    listed,
    percent,
    signal_name,
    signal_unit,
)
from pma_gym.discovery.report.noise_text import nuisance_text
from pma_gym.discovery.report.size_text import sized_effects
from pma_gym.discovery.report.unknown_text import unknown_sentence
from pma_gym.discovery.result.candidate import ADDED
from pma_gym.discovery.thresholds import OFF_ODDS, SAME_PARAMETERS, SLIGHT, UNDETECTABLE_SHARE
from pma_gym.discovery.verdict.adequacy import OPEN
from pma_gym.discovery.verdict.decision import is_ambiguous
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.residual_fraction import ResidualFraction
from pma_gym.discovery.verdict.unknown import Reason
from pma_gym.units import with_unit

VERDICTS = {
    "effect": "An effect is missing",
    "parameters": "Parameters were off",
    "agrees": "Model and data agree",
    "unknown": "Something unknown is missing",
    "undecidable": "Undecidable from these data",
}
"""Each verdict in a few words."""


def sentence(diagnosis: Diagnosis, unknown: Reason | None = None) -> str:
    """The verdict as a person would say it.

    Args:
        diagnosis: the diagnosis.
        unknown: why its verdict is `unknown`; None where it is another.
    """
    trials = trials_text(diagnosis)
    name = diagnosis.given.name
    if diagnosis.verdict == "effect":
        return (
            f"In {trials} model {name} misses {sized_effects(diagnosis.effects)}"
            f"{_approximately(diagnosis)}{_closed(diagnosis)}{_unsure(diagnosis)}."
        )
    if diagnosis.verdict == "parameters":
        off = [path for path, moved in diagnosis.parameters.items() if moved.significant]
        shown = ", ".join(map(_change_of(diagnosis), off[:3]))
        more = f" and {len(off) - 3} more" if len(off) > 3 else ""
        return (
            f"Model {name} has the right structure for {trials}{agreement(diagnosis)}, but its "
            f"parameters are off: {shown}{more}{_closed(diagnosis)}{_unsure(diagnosis)}."
        )
    if diagnosis.verdict == "agrees":
        return (
            f"Model {name} agrees with {trials}{agreement(diagnosis)}: what is left is "
            f"{remainder(diagnosis)}."
        )
    if unknown is not None:
        return unknown_sentence(diagnosis, unknown, trials)
    if diagnosis.candidates and diagnosis.candidates[0].why == ADDED:
        equal = [each.name for each in diagnosis.candidates if "as well as" in each.why]
        added = [each.name for each in diagnosis.candidates if each.why == ADDED]
        if not is_ambiguous(added[0], equal):
            instead = f" (or {effect_names(equal, 'or')})" if equal else ""
            return (
                f"Model {name} misses something, {effect_names(added)}{instead} most likely, but "
                f"what is left out of {trials} does not confirm it"
            ) + _propose(diagnosis)
        rivals = effect_names([diagnosis.candidates[0].name, *equal], "or")
        return (
            f"Model {name} misses something, but {rivals} are not identifiable in {trials}"
        ) + _propose(diagnosis)
    few_hidden = len(diagnosis.not_detectable) <= UNDETECTABLE_SHARE * max(
        len(diagnosis.candidates), 1
    )
    if few_hidden and any(each.fault in OPEN for each in diagnosis.adequacy.values()):
        return (
            f"Whether model {name} misses anything is undecidable from {trials}: "
            f"{undecided(diagnosis)}."
        )
    best = diagnosis.candidates[0] if diagnosis.candidates else None
    if best is not None and few_hidden:
        return (
            f"Model {name} may miss something, {effect_name(best.name)} most likely, but it shows "
            f"in too little of {trials} to rule chance out"
        ) + _propose(diagnosis)
    return (
        f"Whether model {name} misses anything is undecidable from {trials}: "
        f"{len(diagnosis.not_detectable)} effects of the catalogue would not show at their usual "
        "size"
    ) + _propose(diagnosis)


def trials_text(diagnosis: Diagnosis) -> str:
    """The trials in words: pieces of one log are not taken for trials."""
    count = len(diagnosis.trials)
    files = len({record.file for record in diagnosis.trials})
    if files == count:
        return f"these {count} trials" if count != 1 else "this trial"
    return f"{f'these {files} trials' if files != 1 else 'this trial'} (in {count} pieces)"


def _propose(diagnosis: Diagnosis) -> str:
    following = diagnosis.next_experiment
    return f"; measure next: {following.excitation}." if following else "."


def _approximately(diagnosis: Diagnosis) -> str:
    known = diagnosis.approximate
    return "" if known is None else f" ({left_text(known)})"


def _unsure(diagnosis: Diagnosis) -> str:
    """What the headline adds: a fit that did not converge, signals and trials that got worse."""
    words = "" if diagnosis.converged else "; the fit did not converge, so its values are rough"
    signals, trials = diagnosis.worsened
    worse = []
    for signal in signals:
        gap = diagnosis.gap[signal]
        worse.append(
            f"{signal_name(signal)} ({figure(gap.before)} to {figure(gap.after)} "
            f"{signal_unit(signal)})"
        )
    more = f" and {len(trials) - 3} more" if len(trials) > 3 else ""
    worse += [f"{', '.join(trials[:3])}{more}"] if trials else []
    return words + (f"; but it fits {listed(worse)} worse than the model as given" if worse else "")


def _closed(diagnosis: Diagnosis) -> str:
    gaps = {
        signal: gap.closed
        for signal, gap in diagnosis.gap.items()
        if gap.closed is not None and gap.before > 1.1 * gap.floor
    }
    if not gaps:
        return ""
    effect, by_signal = diagnosis.verdict == "effect", diagnosis.gap
    widest = max(
        gaps,
        key=lambda signal: (
            (by_signal[signal].parameters if effect else by_signal[signal].before)
            / by_signal[signal].floor
        ),
    )
    gap = by_signal[widest]
    refitted = f" ({figure(gap.parameters)} with its parameters refitted)" if effect else ""
    unseen = " of trials that it was not fitted to" if gap.held_out else ""
    return (
        f"; the amended model brings the misfit of {signal_name(widest)} from "
        f"{figure(gap.before)}{refitted} to {figure(gap.after)} {signal_unit(widest)} (noise "
        f"{figure(gap.floor)}), "
        f"{percent(max(gap.closed or 0.0, 0.0))} of the gap{unseen}"
    )


def _change_of(diagnosis: Diagnosis):  # noqa: ANN202
    def words(path: str) -> str:
        moved = diagnosis.parameters[path]
        limit = at_its_limit(moved.now)
        now, start = distinct(moved.now.value, moved.start)
        return f"{path} {now}{limit} instead of {start}"

    return words


def unidentified(path: str, fit: Fitted, own: FreeParameters) -> str:
    """Why the data do not determine a parameter."""
    at = fit.paths.index(path)
    spread = np.sqrt(np.diag(fit.covariance))
    if not np.isfinite(spread[at]):
        return "it changes nothing in these trials"
    other = twin(path, fit)
    if other is not None:
        return f"{other} does the same to the signals"
    prior = own.prior[own.free.index(path)]
    return (
        f"these trials hold it to {with_unit(f'{spread[at]:.2g}', unit(path))}, hardly less than "
        f"the {prior:.2g} that was assumed beforehand"
    )


def doubt(path: str, fit: Fitted, own: FreeParameters) -> str:
    """What speaks against a parameter that is named although another could stand for it."""
    others = "if that one is off" if twin(path, fit) else "if others are off instead"
    return f"{path}: {unidentified(path, fit, own)}; {others}, {path} may be as it was given"


def twin(path: str, fit: Fitted) -> str | None:
    """The parameter that does the same to the signals as another; None where none does."""
    at = fit.paths.index(path)
    spread = np.sqrt(np.diag(fit.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.abs(fit.covariance[at] / (spread * spread[at]))
    alike[at] = 0.0
    alike = np.where(np.isfinite(alike), alike, 0.0)
    return fit.paths[int(np.argmax(alike))] if alike.max(initial=0.0) > SAME_PARAMETERS else None


def steps(findings: Findings, diagnosis: Diagnosis, left: ResidualFraction) -> tuple[str, ...]:
    """What was done, a sentence each."""
    problem, selection = findings.problem, findings.selection
    beside = nuisance_text(diagnosis.nuisances, len(diagnosis.floors))
    zeros = [each.name for each in findings.given.rig.signals if each.has_free_zero]
    said = [
        f"Noise: {', '.join(_floor(diagnosis, signal) for signal in diagnosis.floors)}."
        + (f" Fitted together with every candidate: {beside}." if beside else ""),
        f"Parameters first: {len(problem.own.free)} parameters of {findings.given.name} were "
        f"refitted, with the zeros of {' and '.join(zeros)} free in every trial; each is held to "
        "its value as by a measurement with 10 % error, which counts only where the trials do not "
        "determine it.",
    ]
    for number, stage in enumerate(selection.stages, 1):
        best = stage.scores[0]
        said.append(
            f"Round {number}: {len(stage.scores)} candidates were scored; {best.candidate.name} "
            f"could explain most (chi-square {best.gain:.4g}, family-wise p {best.p_value:.2g}, "
            f"{best.change:.2g} of the noise in its clearest signal). "
            + (
                f"{len(stage.fits)} were fitted."
                if stage.fits
                else "None explains more than chance, or arithmetic, would."
            )
            + (
                " Quarters of a second of the residual are beyond what noise can do "
                f"({chance(stage.scan.chance)}): that opened the gate, and the best explains them."
                if stage.scan.excess
                else ""
            )
        )
    if selection.chosen:
        said.append(
            f"Of what was slow in the residual, {percent(left.slow)} is left by "
            f"{effect_names([candidate.name for candidate in selection.chosen])}; of its "
            f"autocorrelation, {percent(left.autocorrelated)}."
        )
    if findings.elimination is not None:
        said.append(
            _named(len(findings.elimination.fit.paths), len(problem.own.free), diagnosis.verdict)
        )
    if findings.unseen is not None:
        said.append(
            "Trials were left out in up to six parts; curves and gaps after the amendment are of "
            "fits that had not seen them."
        )
    return tuple(said)


def _named(count: int, free: int, verdict: Verdict) -> str:
    """How many parameters are said to be off, and what that takes for granted."""
    if not count:
        return f"Parameters that are off: none of {free} is needed to explain these trials."
    said = (
        f"Parameters that are off: {count} of {free} {'is' if count == 1 else 'are'} needed to "
        f"explain these trials, by odds of {OFF_ODDS:g} to 1 or more if the others are as they "
        "were given. "
    )
    if verdict == "agrees":
        return said + (
            f"But with all refitted the signals change by less than {SLIGHT:g} of the noise: "
            "the model stays as it was given."
        )
    return said + (
        "Intervals are no narrower than with all parameters free, as the others may be a little "
        "off too."
    )


def _floor(diagnosis: Diagnosis, signal: str) -> str:
    floor = diagnosis.floors[signal]
    return f"{signal} {floor.value:.3g} ({floor.source})"
