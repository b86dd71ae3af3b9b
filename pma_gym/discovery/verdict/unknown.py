"""Unknown: whether something is missing that no effect carries, and which figure tells so."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.screening.residuals import autocorrelation_tests, left_in_noises
from pma_gym.discovery.thresholds import (
    ALIKE_BESIDE,
    APPROXIMATE_LEFT,
    CERTAIN,
    COMPLETE,
    CONFIDENCE,
    DOUBTFUL,
    EXTRAPOLATED,
    LARGEST_NOISE,
    MOST_AUTOCORRELATED,
    MOST_EXPLAINED,
    MOST_OF_RIVALS,
    MOST_OF_SHAPES,
    MOST_SPREAD,
    SHAPE_FACTOR,
    SHAPE_GAIN,
    SLOW_LEFT,
    WORTH_DRAWING,
)
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.homogeneity_test import homogeneity_test
from pma_gym.discovery.verdict.residual_fraction import ResidualFraction
from pma_gym.discovery.verdict.residual_laws import EstimatedLaw, estimated_laws
from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import signals

PLACES = (set[str](), {"position"}, {"angle"}, {"contraction"})
"""What a law of the position alone takes, constants among them."""

Why = Literal[
    "unexplained",
    "misfit",
    "explained",
    "slow",
    "autocorrelated",
    "scatters",
    "outdone",
    "undetermined",
    "alike",
]
"""`unexplained`: the residual is no noise, and no effect was added. `misfit`: nor is it, it exceeds
the signal's floor (`adequacy`). `explained`: nor is it, a flexible regression explains it. `slow`:
too much of what was slow in it is left. `autocorrelated`: too much of its autocorrelated part is
left. `scatters`: an effect has another size by trial or condition. `outdone`: a freely drawn law
explains more. `undetermined`: each of several laws of the position may be absent beside the
others. `alike`: what drifts is alike in all trials (`common_drift`)."""


@dataclass(frozen=True)
class Reason:
    """Why the verdict is `unknown`: the first figure that is beyond its limit.

    Attributes:
        why: see `Why`.
        figure: what was found: standard errors (`unexplained`), floors (`misfit`, `explained`), a
            share (`slow`, `autocorrelated`, `scatters`), the fall of chi-square by the law
            (`outdone`), the size of an effect in its standard errors (`undetermined`), or a chance
            (`alike`).
        limit: the most that it may be, in the same unit.
        effects: what was added; empty if nothing was.
        nearest: the likeliest effect, where nothing was added; empty if none was looked at.
        leaves: share that the effects leave of what was slow in the residual, or that the nearest
            leaves of chi-square.
        of: signal, by its column (`unexplained`, `misfit`, `explained`), effect whose size scatters
            (`scatters`), or name of the law (`outdone`).
        by: what the size scatters with: `trial` or an output.
        gain: fall of chi-square by the effects (`outdone`).
        final: whether the effects are not even named as approximate laws.
    """

    why: Why
    figure: float
    limit: float
    effects: tuple[str, ...] = ()
    nearest: str = ""
    leaves: float = 1.0
    of: str = ""
    by: str = ""
    gain: float = 0.0
    final: bool = False


def why_unknown(
    findings: Findings, left: ResidualFraction, laws: Sequence[EstimatedLaw]
) -> Reason | None:
    """Why something is missing that no effect of the catalogue carries; None where that is not so.

    Args:
        findings: what the steps found.
        left: what the effects leave of the residual.
        laws: laws without a shape of their own, the one that explains most first.
    """
    reason = _beyond(findings, left, laws)
    if reason is None and not findings.selection.chosen:
        reason = _inadequate(findings)
    if reason is None:
        return None
    chosen = tuple(candidate.name for candidate in findings.selection.chosen)
    if chosen:
        return replace(reason, effects=chosen, leaves=left.slow)
    if not findings.selection.stages:
        return reason
    nearest, leaves = _nearest(findings)
    return replace(reason, nearest=nearest, leaves=leaves)


def leaves_structure(findings: Findings, left: ResidualFraction) -> Reason | None:
    """Why effects that passed every other test are not it; None where they are.

    What they leave is no noise, and more than an approximate law may leave.

    Args:
        findings: what the steps found.
        left: what the effects leave of the residual.
    """
    problem, chosen = findings.problem, findings.selection.chosen
    if not chosen:
        return None
    alike = _alike(findings)
    if alike is not None:
        return replace(alike, effects=tuple(each.name for each in chosen), leaves=left.slow)
    before = problem.sum_of_squares(findings.refitted.model) - problem.count
    after = problem.sum_of_squares(findings.selection.fit.model, chosen) - problem.count
    drawn = _undetermined(findings) or _drawn_by_shapes(findings, after > MOST_OF_RIVALS * before)
    if drawn is not None:
        return replace(drawn, effects=tuple(each.name for each in chosen), leaves=left.slow)
    if after <= APPROXIMATE_LEFT * before:
        return None
    reason = _inadequate(findings) or _far_off(findings)
    names = tuple(candidate.name for candidate in chosen)
    return None if reason is None else replace(reason, effects=names, leaves=left.slow)


def _alike(findings: Findings) -> Reason | None:
    """Something slow that begins with every trial is left, which is no drift of a sensor."""
    alike = findings.adequacy.alike
    if alike is None:
        return None
    name, judged = alike
    return Reason("alike", judged.common, ALIKE_BESIDE, of=BY_QUANTITY[name].name, final=True)


def _undetermined(findings: Findings) -> Reason | None:
    """Several laws of the position alone, each of which may be absent beside the others.

    Together they draw a curve that neither has: a spring and a weight far from where they are
    relaxed draw a bumper.
    """
    fit, sizes = findings.selection.fit, list[float]()
    for candidate in findings.selection.chosen:
        if not _of_place(candidate.effect):
            continue
        named = zip(candidate.paths, candidate.amplitudes, candidate.absent.tolist(), strict=True)
        known = [
            (*fit.estimate(path), neutral)
            for path, amplitude, neutral in named
            if amplitude and path in candidate.fitted_paths
        ]
        sizes.append(max((abs(size - none) / error for size, error, none in known), default=np.inf))
    undetermined = [size for size in sizes if size < CONFIDENCE]
    if len(undetermined) <= 1:
        return None
    return Reason("undetermined", max(undetermined), CONFIDENCE, final=True)


def _drawn_by_shapes(findings: Findings, much: bool) -> Reason | None:
    """Two laws of the position alone, such as a spring and a weight, that leave more than noise.

    Their difference draws any bent curve about as well, and so does each of two rivals with the
    model's own parameters refitted; where the right ones are there they leave noise.

    Args:
        findings: what the steps found.
        much: whether so much of the misfit is left that rivals count.
    """
    chosen, drawing = findings.selection.chosen, []
    for place, candidate in enumerate(chosen):
        if _of_place(candidate.effect):
            rivals = findings.rivals[place] if findings.rivals else ()
            drawing.append(candidate.effect)
            drawing += [rival.candidate.effect for rival in rivals if rival.equal and much]
    drawing = [name for name in drawing if _of_place(name)]
    if len(drawing) <= 1:
        return None
    sizes = left_in_noises(findings.problem, findings.selection.fit, chosen)
    name = max(sizes, key=lambda each: sizes[each])
    if sizes[name] <= MOST_OF_SHAPES:
        return None
    return Reason("misfit", sizes[name], MOST_OF_SHAPES, of=BY_QUANTITY[name].name, final=True)


def _of_place(name: str) -> bool:
    """Whether an effect's law takes the position alone, or nothing: a constant."""
    law = CATALOGUE[name].law
    return law is not None and set(signals(law)) - {"p"} in PLACES


def _far_off(findings: Findings) -> Reason | None:
    """The residual is no noise by its size, where nothing but the sensor says what noise is."""
    selection = findings.selection
    sizes = left_in_noises(findings.problem, selection.fit, selection.chosen)
    name = max(sizes, key=lambda each: sizes[each])
    if sizes[name] <= LARGEST_NOISE:
        return None
    return Reason("misfit", sizes[name], LARGEST_NOISE, of=BY_QUANTITY[name].name)


def _beyond(
    findings: Findings, left: ResidualFraction, laws: Sequence[EstimatedLaw]
) -> Reason | None:
    """The first figure beyond its limit, cheap ones first."""
    if not findings.selection.chosen and _missing(findings):
        return _unexplained(findings)
    if not gate(findings):
        return None
    if left.slow > SLOW_LEFT:
        return Reason("slow", left.slow, SLOW_LEFT)
    if left.autocorrelated > MOST_AUTOCORRELATED:
        return Reason("autocorrelated", left.autocorrelated, MOST_AUTOCORRELATED)
    return _scatters(findings, left) or _outdone(findings, laws)


def gate(findings: Findings) -> bool:
    """Whether anything passed the gate."""
    return bool(findings.selection.stages and findings.selection.stages[0].gate)


def _missing(findings: Findings) -> bool:
    """Whether the residual says of itself that something is missing."""
    return bool(findings.selection.stages and findings.selection.stages[0].missing)


def _inadequate(findings: Findings) -> Reason | None:
    """The residual is no noise: by its size, or by what a flexible regression explains of it."""
    if findings.adequacy.structure is None:
        return None
    name, signal = findings.adequacy.structure
    column = BY_QUANTITY[name].name
    if signal.fault == "explained":
        return Reason("explained", signal.explained, MOST_EXPLAINED, of=column)
    return Reason("misfit", signal.fitted, COMPLETE, of=column)


def _unexplained(findings: Findings) -> Reason | None:
    """The residual is no noise: by the signal whose autocorrelation is surest."""
    stage = findings.selection.stages[0]
    sure = {
        name: each
        for name, each in autocorrelation_tests(stage.problem, stage.before).items()
        if each.sure
    }
    if not sure:
        return _inadequate(findings)
    signal = max(sure, key=lambda name: sure[name].score)
    return Reason("unexplained", sure[signal].score, CERTAIN, of=BY_QUANTITY[signal].name)


def _nearest(findings: Findings) -> tuple[str, float]:
    """The likeliest effect where none was added, and the share of chi-square that it leaves."""
    stage = findings.selection.stages[0]
    before = stage.before.chi_square
    gains = {name: before - fit.chi_square for name, fit in stage.fits.items()}
    gains = gains or {score.candidate.name: score.gain for score in stage.scores}
    if not gains:
        return "", 1.0
    name = max(gains, key=lambda each: gains[each])
    return name, 1.0 - gains[name] / before


def shapeless_laws(findings: Findings, left: ResidualFraction) -> list[EstimatedLaw]:
    """Laws without a shape of their own, where the effects leave room for one."""
    if not (gate(findings) or _missing(findings)):
        return []
    if left.most < DOUBTFUL and _scatters(findings, left) is None:
        return []
    return estimated_laws(findings.selection.problem, findings.refitted)


def widest_scatter(findings: Findings) -> float:
    """How much the size of an effect that was selected scatters, where it scatters most."""
    selection = findings.selection
    return max(
        (
            scatter
            for place in range(len(selection.chosen))
            for scatter in homogeneity_test(
                selection.problem, selection.fit, selection.chosen, place
            ).values()
        ),
        default=0.0,
    )


def _scatters(findings: Findings, left: ResidualFraction) -> Reason | None:
    """The first effect that was selected whose size differs by trial or by condition, and how."""
    selection, most = findings.selection, np.inf if left.most >= DOUBTFUL else EXTRAPOLATED
    for place, candidate in enumerate(selection.chosen):
        by = homogeneity_test(selection.problem, selection.fit, selection.chosen, place)
        wide = {name: scatter for name, scatter in by.items() if MOST_SPREAD < scatter <= most}
        if wide:
            most = max(wide, key=lambda name: wide[name])
            return Reason("scatters", wide[most], MOST_SPREAD, of=candidate.name, by=most)
    return None


def _outdone(findings: Findings, laws: Sequence[EstimatedLaw]) -> Reason | None:
    """A freely drawn law that explains more than the effects do."""
    if not laws:
        return None
    selection = findings.selection
    whitened = selection.problem.whitened_residuals(findings.refitted.model)
    before = whitened.sums(findings.refitted.values, np.empty(0)).chi_square
    gain = before - selection.fit.chi_square
    limit = max(SHAPE_FACTOR * gain, gain + SHAPE_GAIN)
    if laws[0].gain > limit:
        return Reason("outdone", laws[0].gain, limit, of=laws[0].name, gain=gain)
    return None


def telling(findings: Findings, laws: Sequence[EstimatedLaw]) -> bool:
    """Whether the best freely drawn law explains enough to be shown."""
    if not laws:
        return False
    whitened = findings.selection.problem.whitened_residuals(findings.refitted.model)
    count = sum(logged.count for logged in whitened.logged)
    before = whitened.sums(findings.refitted.values, np.empty(0)).chi_square
    return laws[0].gain > max(SHAPE_GAIN, WORTH_DRAWING * (before - count))
