"""A diagnosis in sentences: its verdict, what was done, and why a parameter is not determined."""

from typing import TYPE_CHECKING

import numpy as np

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.fits import Fitted
from pma_gym.discovery.parameters import Own, unit

if TYPE_CHECKING:
    from pma_gym.discovery.answer import Findings

ALIKE = 0.9
"""Correlation from which on two parameters do the same to the signals."""


def sentence(diagnosis: Diagnosis, left: float) -> str:
    """The verdict as a person would say it."""
    count = len(diagnosis.trials)
    trials = f"{count} trial{'s' if count != 1 else ''}"
    name = diagnosis.given.name
    if diagnosis.verdict == "effect":
        return f"In these {trials} model {name} misses {_effects(diagnosis)}{_closed(diagnosis)}."
    if diagnosis.verdict == "parameters":
        off = [path for path, moved in diagnosis.parameters.items() if moved.significant]
        shown = ", ".join(map(_change_of(diagnosis), off[:3]))
        more = f" and {len(off) - 3} more" if len(off) > 3 else ""
        return (
            f"Model {name} has the right structure for these {trials}, but its parameters are off: "
            f"{shown}{more}{_closed(diagnosis)}."
        )
    if diagnosis.verdict == "agrees":
        return f"Model {name} agrees with these {trials}: what is left is the noise of the sensors."
    if diagnosis.verdict == "unknown":
        return (
            f"Something is missing in model {name} that no effect of the catalogue carries: of "
            f"what is slow in the residual of these {trials}, the best leaves {left:.0%}."
        )
    if diagnosis.candidates and diagnosis.candidates[0].why == "added to the model":
        equal = [each.name for each in diagnosis.candidates if "as well as" in each.why]
        rivals = ", ".join([diagnosis.candidates[0].name, *equal])
        return (
            f"Model {name} misses something, but these {trials} cannot tell which of {rivals} it is"
        ) + _propose(diagnosis)
    return (
        f"These {trials} cannot tell whether model {name} misses anything: "
        f"{len(diagnosis.blind)} effects of the catalogue would not have shown at their usual size"
    ) + _propose(diagnosis)


def _propose(diagnosis: Diagnosis) -> str:
    following = diagnosis.next_experiment
    return f"; measure next: {following.protocol}." if following else "."


def _effects(diagnosis: Diagnosis) -> str:
    named = []
    for effect in diagnosis.effects:
        sizes = ", ".join(
            f"{parameter} {estimate.value:.3g}" for parameter, estimate in effect.parameters.items()
        )
        doubt = f", or {' or '.join(effect.confused_with)}" if effect.confused_with else ""
        named.append(f"{effect.name.replace('_', ' ')} ({sizes}){doubt}")
    return " and ".join(named)


def _closed(diagnosis: Diagnosis) -> str:
    gaps = {
        signal: gap.closed
        for signal, gap in diagnosis.gap.items()
        if gap.closed is not None and gap.before > 1.1 * gap.floor
    }
    if not gaps:
        return ""
    widest = max(
        gaps, key=lambda signal: diagnosis.gap[signal].before / diagnosis.gap[signal].floor
    )
    gap = diagnosis.gap[widest]
    unseen = " of trials that it was not fitted to" if gap.held_out else ""
    return (
        f"; the amended model brings {widest} from {gap.before:.3g} to {gap.after:.3g} "
        f"(noise {gap.floor:.3g}), {max(gap.closed or 0.0, 0.0):.0%} of the gap{unseen}"
    )


def _change_of(diagnosis: Diagnosis):  # noqa: ANN202
    def words(path: str) -> str:
        moved = diagnosis.parameters[path]
        return f"{path} {moved.now.value:.4g} instead of {moved.start:.4g}"

    return words


def unidentified(path: str, fit: Fitted, own: Own) -> str:
    """Why the data do not determine a parameter."""
    at = fit.paths.index(path)
    spread = np.sqrt(np.diag(fit.covariance))
    if not np.isfinite(spread[at]):
        return "it changes nothing in these trials"
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.abs(fit.covariance[at] / (spread * spread[at]))
    alike[at] = 0.0
    alike = np.where(np.isfinite(alike), alike, 0.0)
    if alike.max(initial=0.0) > ALIKE:
        return f"{fit.paths[int(np.argmax(alike))]} does the same to the signals"
    prior = own.prior[own.free.index(path)]
    return (
        f"these trials hold it to {spread[at]:.2g} {unit(path)}, hardly less than the "
        f"{prior:.2g} that was assumed beforehand"
    )


def steps(found: "Findings", diagnosis: Diagnosis, left: float) -> tuple[str, ...]:
    """What was done, a sentence each."""
    bench, selection = found.bench, found.selection
    said = [
        f"Noise: {', '.join(_floor(diagnosis, signal) for signal in diagnosis.floors)}.",
        f"Parameters first: {len(bench.own.free)} numbers of {found.given.name} were refitted, "
        "with the zeros of contraction and rotation free in every trial; each is held to its value "
        "as by a measurement with 10 % error, which counts only where the trials say nothing.",
    ]
    for number, stage in enumerate(selection.stages, 1):
        best = stage.looks[0]
        said.append(
            f"Round {number}: {len(stage.looks)} effects were looked at; {best.suspect.name} could "
            f"explain most (chi-square {best.gain:.4g}, family-wise p {best.p_value:.2g}, "
            f"{best.change:.2g} of the noise in its clearest signal). "
            + (
                f"{len(stage.fits)} were fitted."
                if stage.fits
                else "None explains more than chance, or arithmetic, would."
            )
        )
    if selection.chosen:
        said.append(
            f"Of what was slow in the residual, {left:.0%} is left by "
            f"{' and '.join(suspect.name for suspect in selection.chosen)}."
        )
    if found.unseen is not None:
        said.append(
            "Trials were left out in up to six parts; curves and gaps after the amendment are of "
            "fits that had not seen them."
        )
    return tuple(said)


def _floor(diagnosis: Diagnosis, signal: str) -> str:
    floor = diagnosis.floors[signal]
    return f"{signal} {floor.value:.3g} ({floor.source})"
