"""Plots of what was named, against the size of the effect."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.hidden_effects.evaluation.scoring import rate
from pma_gym.pages.figures import legend_below, picture, png

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
        panel.set_ylim(0.0, 103.0)
        panel.set_xlabel("size r of the effect over the noise, after a refit without it")
        panel.set_ylabel("cases (%)")
        legend_below(drawn, panel.get_legend_handles_labels()[0], 3)
        return png(drawn)
