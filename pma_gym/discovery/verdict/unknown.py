"""Unknown: whether something is missing that no effect carries, and which figure tells so."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.screening.autocorrelation import SURE
from pma_gym.discovery.screening.residuals import memories
from pma_gym.discovery.verdict.adequacy import MOST_EXPLAINED, MOST_FLOORS
from pma_gym.discovery.verdict.findings import Findings
from pma_gym.discovery.verdict.homogeneity_test import spreads
from pma_gym.discovery.verdict.residual_fraction import Left
from pma_gym.discovery.verdict.residual_laws import Drawn, drawn_laws

MOST_LEFT = 0.35
"""Share of what was slow in the residual that may be left by effects that explain it."""

DOUBTFUL = 0.08
"""The same, from which on laws without a shape of their own are set against the effects."""

BETTER, BETTER_BY = 1.15, 60.0
"""By how much such a law must explain more than the effects to say that they are not it: a factor
on their gain in chi-square, and chi-square."""

WORTH_DRAWING = 0.15
"""Share of the chi-square beyond noise that such a law must explain to be drawn."""

MOST_REMEMBERED = 0.1
"""Most of what the residual remembered of itself that it may still remember, beyond chance."""

MOST_SPREAD = 0.12
"""Most that an effect's size may scatter by trial or condition, beyond chance, as a share of it."""

EXTRAPOLATED = 1.0
"""Scatter from which on it is extrapolated: sizes of groups come from slopes, which hold for small
changes. Sizes that really scattered by more than themselves would leave a residual; where none is
left, the slopes are wrong, not the law."""

Why = Literal["unexplained", "misfit", "explained", "slow", "remembered", "scatters", "outdone"]
"""`unexplained`: the residual is no noise, and no effect was added. `misfit`: nor is it, it exceeds
the signal's floor (`adequacy`). `explained`: nor is it, a flexible regression explains it. `slow`:
too much of what was slow in it is left. `remembered`: of what it remembered of itself. `scatters`:
an effect has another size by trial or condition. `outdone`: a law without a shape of its own
explains more."""


@dataclass(frozen=True)
class Reason:
    """Why the verdict is `unknown`: the first figure that is beyond its limit.

    Attributes:
        why: see `Why`.
        figure: what was found: standard errors (`unexplained`), floors (`misfit`, `explained`), a
            share (`slow`, `remembered`, `scatters`), or the fall of chi-square by the law
            (`outdone`).
        limit: the most that it may be, in the same unit.
        effects: what was added; empty if nothing was.
        nearest: the likeliest effect, where nothing was added; empty if none was looked at.
        leaves: share that the effects leave of what was slow in the residual, or that the nearest
            leaves of chi-square.
        of: signal, by its column (`unexplained`, `misfit`, `explained`), effect whose size scatters
            (`scatters`), or name of the law (`outdone`).
        by: what the size scatters with: `trial` or an output.
        gain: fall of chi-square by the effects (`outdone`).
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


def why_unknown(found: Findings, left: Left, laws: Sequence[Drawn]) -> Reason | None:
    """Why something is missing that no effect of the catalogue carries; None where that is not so.

    Args:
        found: what the steps found.
        left: what the effects leave of the residual.
        laws: laws without a shape of their own, the one that explains most first.
    """
    reason = _beyond(found, left, laws)
    if reason is None and not found.selection.chosen:
        reason = _inadequate(found)
    if reason is None:
        return None
    chosen = tuple(suspect.name for suspect in found.selection.chosen)
    if chosen:
        return replace(reason, effects=chosen, leaves=left.slow)
    if not found.selection.stages:
        return reason
    nearest, leaves = _nearest(found)
    return replace(reason, nearest=nearest, leaves=leaves)


def _beyond(found: Findings, left: Left, laws: Sequence[Drawn]) -> Reason | None:
    """The first figure beyond its limit, cheap ones first."""
    if not found.selection.chosen and _missing(found):
        return _unexplained(found)
    if not gate(found):
        return None
    if left.slow > MOST_LEFT:
        return Reason("slow", left.slow, MOST_LEFT)
    if left.remembered > MOST_REMEMBERED:
        return Reason("remembered", left.remembered, MOST_REMEMBERED)
    return _scatters(found, left) or _outdone(found, laws)


def gate(found: Findings) -> bool:
    """Whether anything passed the gate."""
    return bool(found.selection.stages and found.selection.stages[0].gate)


def _missing(found: Findings) -> bool:
    """Whether the residual says of itself that something is missing."""
    return bool(found.selection.stages and found.selection.stages[0].missing)


def _inadequate(found: Findings) -> Reason | None:
    """The residual is no noise: by its size, or by what a flexible regression explains of it."""
    if found.adequacy.structure is None:
        return None
    name, signal = found.adequacy.structure
    column = BY_QUANTITY[name].name
    if signal.fault == "explained":
        return Reason("explained", signal.explained, MOST_EXPLAINED, of=column)
    return Reason("misfit", signal.fitted, MOST_FLOORS, of=column)


def _unexplained(found: Findings) -> Reason | None:
    """The residual is no noise: by the signal whose autocorrelation is surest."""
    stage = found.selection.stages[0]
    sure = {name: each for name, each in memories(stage.bench, stage.before).items() if each.sure}
    if not sure:
        return _inadequate(found)
    signal = max(sure, key=lambda name: sure[name].score)
    return Reason("unexplained", sure[signal].score, SURE, of=BY_QUANTITY[signal].name)


def _nearest(found: Findings) -> tuple[str, float]:
    """The likeliest effect where none was added, and the share of chi-square that it leaves."""
    stage = found.selection.stages[0]
    before = stage.before.chi_square
    gains = {name: before - fit.chi_square for name, fit in stage.fits.items()}
    gains = gains or {look.suspect.name: look.gain for look in stage.looks}
    if not gains:
        return "", 1.0
    name = max(gains, key=lambda each: gains[each])
    return name, 1.0 - gains[name] / before


def shapeless_laws(found: Findings, left: Left) -> list[Drawn]:
    """Laws without a shape of their own, where the effects leave room for one."""
    if not (gate(found) or _missing(found)):
        return []
    if left.most < DOUBTFUL and _scatters(found, left) is None:
        return []
    return drawn_laws(found.selection.bench, found.refitted)


def _scatters(found: Findings, left: Left) -> Reason | None:
    """The first effect that was selected whose size differs by trial or by condition, and how."""
    selection, most = found.selection, np.inf if left.most >= DOUBTFUL else EXTRAPOLATED
    for place, suspect in enumerate(selection.chosen):
        by = spreads(selection.bench, selection.fit, selection.chosen, place)
        wide = {name: scatter for name, scatter in by.items() if MOST_SPREAD < scatter <= most}
        if wide:
            most = max(wide, key=lambda name: wide[name])
            return Reason("scatters", wide[most], MOST_SPREAD, of=suspect.name, by=most)
    return None


def _outdone(found: Findings, laws: Sequence[Drawn]) -> Reason | None:
    """A law without a shape of its own that explains more than the effects do."""
    if not laws:
        return None
    selection = found.selection
    evidence = selection.bench.evidence(found.refitted.model)
    before = evidence.sums(found.refitted.values, np.empty(0)).chi_square
    gain = before - selection.fit.chi_square
    limit = max(BETTER * gain, gain + BETTER_BY)
    if laws[0].gain > limit:
        return Reason("outdone", laws[0].gain, limit, of=laws[0].name, gain=gain)
    return None


def telling(found: Findings, laws: Sequence[Drawn]) -> bool:
    """Whether the best law without a shape of its own explains enough to be drawn."""
    if not laws:
        return False
    evidence = found.selection.bench.evidence(found.refitted.model)
    count = sum(logged.count for logged in evidence.logged)
    before = evidence.sums(found.refitted.values, np.empty(0)).chi_square
    return laws[0].gain > max(BETTER_BY, WORTH_DRAWING * (before - count))
