"""Counts over cases: rates with Wilson's interval and their targets, gaps, sizes, confusions.

Plots of what was named, against the size of the effect.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.hidden_effects.evaluation.records import CaseRecord
from benchmarks.hidden_effects.evaluation.targets import (
    COVERAGE,
    GAP_BLOCKS,
    GAP_MEDIAN,
    GAP_TENTH,
    RATES,
    SIZE_ERROR,
    Target,
)
from benchmarks.hidden_effects.evaluation.verdicts import Outcome, compare, no_answer
from pma_gym.pages.figures import legend_below, picture, png

Z = 1.959964
"""Of a 95 % interval."""


SIZES = (0.0, 0.25, 0.4, 0.7, 1.0, 1.5, 2.5, 100.0)
"""Edges of the ranges of r that rates are counted in."""


def outcome_of(record: CaseRecord) -> Outcome:
    """The outcome of a case that the job kept."""
    answer = no_answer(record.message) if record.answer is None else record.answer
    outcome = compare(record.truth, answer)
    outcome.number = record.number
    outcome.seconds = record.seconds.get("diagnose")
    return outcome


def wilson(hits: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a rate.

    >>> [round(end, 3) for end in wilson(0, 400)]
    [0.0, 0.01]
    """
    if n == 0:
        return 0.0, 1.0
    share, square = hits / n, Z * Z / n
    middle = (share + 0.5 * square) / (1.0 + square)
    half = Z / (1.0 + square) * math.sqrt(share * (1.0 - share) / n + square / (4.0 * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def rate(hits: Iterable[bool | None], target: Target | None = None) -> dict[str, Any]:
    """How many of those that count hit, and whether that meets a target; None does not count."""
    counted = [hit for hit in hits if hit is not None]
    low, high = wilson(sum(counted), len(counted))
    share = sum(counted) / len(counted) if counted else None
    figure = {"rate": share, "low": low, "high": high, "hits": sum(counted), "n": len(counted)}
    return figure | _beside(share, target)


def count(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """All figures by block."""
    names = dict.fromkeys(outcome.block for outcome in outcomes)
    return {"blocks": {name: _block(name, outcomes) for name in names}}


def _block(name: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    some = [outcome for outcome in outcomes if outcome.block == name]
    rates = RATES[name]
    return {
        "n": len(some),
        "rates": {each.name: rate(map(each.hit, some), each.target) for each in rates},
        "by_size": _by_size(some),
        "gap_closed": _gap_closed(name, some),
        "sizes": _sizes(some),
        "parameters": _held(some),
        "seconds": _seconds(some),
        "misses": [_miss(outcome) for outcome in some if _missed(outcome)],
        "unanswered": [_miss(outcome) for outcome in some if not outcome.answered],
    }


def _beside(value: float | None, target: Target | None) -> dict[str, Any]:
    """A target and whether it is met; nothing where there is none."""
    if target is None:
        return {}
    return {"target": target.text(), "met": None if value is None else target.met(value)}


def _amount(value: float | None, target: Target | None) -> dict[str, Any]:
    return {"value": value} | _beside(value, target)


def _by_size(some: Sequence[Outcome]) -> list[dict[str, Any]]:
    """How often effects alone were named, named or their group, and detected, by ranges of r.

    Those that come in one size are left out.
    """
    alone = [o for o in some if len(o.truth) == 1 and o.ratio is not None and o.sized]
    rows = []
    for low, high in pairwise(SIZES):
        those = [each for each in alone if low <= (each.ratio or 0.0) < high]
        if those:
            counted = {
                "named": rate(each.right for each in those),
                "named or its group": rate(each.near for each in those),
                "detected": rate(each.detected for each in those),
            }
            rows.append({"low": low, "high": high, **counted})
    return rows


def _gap_closed(name: str, some: Sequence[Outcome]) -> dict[str, Any]:
    closed = [share for outcome in some for share in outcome.closed]
    has_limit = name in GAP_BLOCKS
    middle = float(np.median(closed)) if closed else None
    tenth = float(np.percentile(closed, 10)) if closed else None
    return {
        "median": _amount(middle, GAP_MEDIAN if has_limit else None),
        "tenth_percentile": _amount(tenth, GAP_TENTH if has_limit else None),
        "n": len(closed),
    }


def _seconds(some: Sequence[Outcome]) -> dict[str, Any]:
    seconds = [outcome.seconds for outcome in some if outcome.seconds is not None]
    return {
        "median": float(np.median(seconds)) if seconds else None,
        "most": max(seconds, default=None),
        "sum": sum(seconds),
    }


def _sizes(some: Sequence[Outcome]) -> dict[str, Any]:
    """Errors and intervals of the sizes of those hidden effects that were named."""
    errors: dict[str, list[float]] = {}
    covered: dict[str, list[bool]] = {}
    for outcome in some:
        for path, error in outcome.size_errors.items():
            errors.setdefault(path, []).append(error)
            covered.setdefault(path, []).append(outcome.covered[path])
    every = [error for each in errors.values() for error in each]
    inside = [covers for each in covered.values() for covers in each]
    return {
        "median_error": _amount(float(np.median(every)) if every else None, SIZE_ERROR),
        "covered": rate(inside, COVERAGE),
        "by_parameter": {
            path: {"median_error": float(np.median(each)), "covered": rate(covered[path])}
            for path, each in sorted(errors.items())
        },
    }


def _held(some: Sequence[Outcome]) -> dict[str, Any]:
    """Intervals of the models' own parameters."""
    by_path: dict[str, list[bool]] = {}
    for outcome in some:
        for path, holds in outcome.held.items():
            by_path.setdefault(path, []).append(holds)
    every = [holds for each in by_path.values() for holds in each]
    return {
        "covered": rate(every, COVERAGE),
        "by_parameter": {path: rate(each) for path, each in sorted(by_path.items())},
    }


def _missed(outcome: Outcome) -> bool:
    """Whether a case is one that the block's target speaks against."""
    if not outcome.answered:
        return True
    if outcome.trouble:
        return outcome.trouble not in ("said", "quiet")
    if outcome.kind == "outside":
        return outcome.verdict != "unknown"
    if outcome.block == "rigs" and outcome.truth:
        return not outcome.near or outcome.hits < len(outcome.truth) - 1 or outcome.false_structure
    if outcome.block == "slow_drift":
        return not (outcome.near or outcome.verdict == "unknown")
    if outcome.block.startswith("single") or outcome.block in ("faint", "pair"):
        return not outcome.right
    if outcome.block == "unknown":
        return outcome.verdict != "unknown"
    if outcome.block == "parameters":
        return outcome.detected or outcome.parameters is False
    return outcome.detected


def _said(outcome: Outcome) -> str:
    """What was said; of parameters, which were named, and which that were off were not."""
    if not outcome.off or outcome.named:
        return outcome.said
    named = f"{outcome.said}: {', '.join(outcome.moved)}" if outcome.moved else outcome.said
    return f"{named}; without {', '.join(outcome.missing)}" if outcome.missing else named


def _miss(outcome: Outcome) -> dict[str, Any]:
    kind = "" if outcome.kind in ("", outcome.hidden) else f", {outcome.kind}"
    return {
        "number": outcome.number,
        "hidden": " ".join([outcome.hidden, *outcome.off]) + kind,
        "r": outcome.ratio,
        "said": _said(outcome),
        "sentence": outcome.sentence,
    }


NAMED, GROUP, DETECTED = "#0072B2", "#009E73", "#D55E00"
"""Okabe and Ito's palette, as in the pictures of a diagnosis."""

KINDS = (
    ("named", NAMED, "o"),
    ("named or its group", GROUP, "s"),
    ("detected", DETECTED, "^"),
)


def pooled(ranges: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rates of several blocks over the same ranges of r, as of one."""
    bins = []
    for ends in sorted({(each["low"], each["high"]) for each in ranges}):
        some = [each for each in ranges if (each["low"], each["high"]) == ends]
        row: dict[str, Any] = {"low": ends[0], "high": ends[1]}
        for kind, _, _ in KINDS:
            hits, count = (sum(each[kind][name] for each in some) for name in ("hits", "n"))
            row[kind] = rate([True] * hits + [False] * (count - hits))
        bins.append(row)
    return bins


def naming_picture(ranges: Sequence[Mapping[str, Any]]) -> bytes:
    """Rates over the size r of what is hidden, with Wilson's intervals, as PNG.

    Args:
        ranges: `by_size` of blocks of one hidden effect, see `scoring.count`; they are pooled.
    """
    with picture(6.4, 3.6) as drawn:
        panel = drawn.subplots()
        for shift, (kind, colour, marker) in zip((0.96, 1.0, 1.04), KINDS, strict=True):
            rows = [each for each in pooled(ranges) if each[kind]["n"]]
            # A range is drawn at its middle by ratios; the first begins at 0.
            at = [shift * np.sqrt(max(each["low"], 0.1) * min(each["high"], 4.0)) for each in rows]
            rates = np.array([each[kind]["rate"] for each in rows])
            below = rates - [each[kind]["low"] for each in rows]
            above = np.array([each[kind]["high"] for each in rows]) - rates
            bars = np.maximum(np.array([below, above]), 0.0)
            panel.errorbar(
                at, 100.0 * rates, 100.0 * bars, fmt=marker, color=colour, label=kind, capsize=3
            )
        panel.set_xscale("log")
        panel.set_xticks([0.1, 0.2, 0.3, 0.5, 1.0, 2.0], ["0.1", "0.2", "0.3", "0.5", "1", "2"])
        panel.minorticks_off()
        panel.set(
            ylim=(0.0, 103.0),
            xlabel="size r of the effect over the noise, after a refit without it",
            ylabel="cases (%)",
        )
        legend_below(drawn, panel.get_legend_handles_labels()[0], 3)
        return png(drawn)
