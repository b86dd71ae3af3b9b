"""README's table of how well the diagnosis does, from the figures that were kept of the runs."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

KEPT = Path(__file__).resolve().parents[3] / "docs" / "figures" / "hidden-effects.json"
"""What runs of `hidden-effects --json` wrote of their blocks, put together."""

ROWS = (
    ("one effect of 0.5 to 2 times the noise: named", "single", "named right"),
    ("... or taken for one of its group", "single", "right or in its group"),
    ("... confidently wrong", "single", "confidently wrong"),
    ("the same at 0.3 times: detected", "faint", "detected"),
    ("... confidently wrong", "faint", "confidently wrong"),
    ("nothing hidden: an alarm", "nothing", "false alarm"),
    ("parameters alone off: the right ones named", "parameters", "right parameter named"),
    ("... where the data can tell", "parameters", "right parameter named, where data can tell"),
    ("... a new effect claimed", "parameters", "a new effect claimed"),
    ("two effects: both named", "pair", "both named"),
    ("... at least one", "pair", "at least one"),
    ("... a third that is not there", "pair", "a spurious third"),
    ("an effect that no catalogue has: `unknown`", "unknown", "unknown"),
    ("... a false name", "unknown", "a false name"),
    ("too little excitation: `undecidable`", "undecidable", "undecidable"),
    ("... settled by two proposed experiments", "undecidable", "proposed, settled in 2 rounds"),
    ("... by two random ones as long", "undecidable", "random, settled in 2 rounds"),
)
"""What each row says, of which block and rate it is."""


def hidden_effects(kept: Path = KEPT) -> str:
    """Every promised rate with its 95 % interval, count and target, as Markdown."""
    blocks = json.loads(kept.read_text("utf-8"))["blocks"]
    lines = ["| | Measured | n | Target |", "| :-- | --: | --: | --: |"]
    for words, block, name in ROWS:
        rate = blocks[block]["rates"][name]
        lines.append(f"| {words} | {_rate(rate)} | {rate['n']} | {_target(rate.get('target'))} |")
    single = blocks["single"]
    gap, sizes = single["gap_closed"], single["sizes"]
    closed = [f"{gap[which]['value']:.3f}" for which in ("median", "tenth_percentile")]
    wanted = [gap[which]["target"] for which in ("median", "tenth_percentile")]
    error, covered = sizes["median_error"], sizes["covered"]
    lines += [
        "| gap closed on trials left out (one effect), median; tenth percentile "
        f"| {'; '.join(closed)} | {gap['n']} | {'; '.join(wanted)} |",
        f"| size of the effect: median error | {100 * error['value']:.1f} % | {covered['n']} "
        f"| {_target(error['target'])} |",
        f"| ... 95 % interval covers the truth | {_rate(covered)} | {covered['n']} "
        f"| {_target(covered['target'])} |",
    ]
    return "\n".join(lines)


def _rate(rate: Mapping[str, Any]) -> str:
    share, low, high = (100.0 * rate[key] for key in ("rate", "low", "high"))
    return f"{share:.1f} % ({low:.1f} to {high:.1f})"


def _target(words: str | None) -> str:
    """A target on shares, in per cent: `>= 0.92` is `>= 92 %`."""
    if words is None:
        return ""
    sign, _, bound = words.rpartition(" ")
    ends = " to ".join(f"{100.0 * float(end):g}" for end in bound.split("-"))
    return f"{sign} {ends} %".strip()
