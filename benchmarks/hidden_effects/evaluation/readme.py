"""README's table of how often the diagnosis is right, from the kept figures of the runs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects.evaluation.measured import measured_text
from pma_gym.documents import read_json

KEPT = Path(__file__).resolve().parents[3] / "docs" / "figures" / "hidden-effects.json"
"""What runs of `hidden-effects --json` wrote of their blocks, put together."""

ROWS = (
    ("one effect, 0.5 to 2 noises: named", "single", "named right"),
    ("... wrongly named", "single", "confidently wrong"),
    ("nothing hidden: an effect claimed", "nothing", "false alarm"),
    ("outside the catalogue: `unknown`", "unknown", "unknown"),
)
"""What each row says, of which block and rate it is; docs/notebook/diagnosis-results.md has all."""


def diagnosis(kept: Path = KEPT) -> str:
    """The rates that a newcomer asks for, with 95 % interval and count, as Markdown."""
    blocks = read_json(kept, "journal_mib", own=True, finite=False)["blocks"]
    lines = ["| | Share (95 %) | Cases |", "| :-- | --: | --: |"]
    for words, block, name in ROWS:
        rate = blocks[block]["rates"][name]
        lines.append(f"| {words} | {_rate(rate)} | {rate['n']} |")
    measured = [
        one for block in dict.fromkeys(row[1] for row in ROWS) for one in blocks[block]["measured"]
    ]
    return "\n".join([*lines, "", measured_text(measured)])


def _rate(rate: Mapping[str, Any]) -> str:
    share, low, high = (100.0 * rate[key] for key in ("rate", "low", "high"))
    return f"{share:.1f} % ({low:.1f}-{high:.1f})"
