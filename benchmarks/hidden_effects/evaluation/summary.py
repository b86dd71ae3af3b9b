"""`python -m benchmarks hidden-effects-report`: several blocks' figures as one document."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects.evaluation.records import Measured, measured_text
from benchmarks.hidden_effects.evaluation.scoring import rate
from benchmarks.hidden_effects.evaluation.targets import COVERAGE, percent
from pma_gym.documents import read_json
from pma_gym.pages.document import Block, Heading, Paragraph, TextTable, to_html, to_markdown

KEPT = Path(__file__).resolve().parents[3] / "docs" / "figures" / "hidden-effects.json"
"""What `hidden-effects-report --out FILE.json` wrote of the blocks."""

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
    for label, block, name in ROWS:
        rate = blocks[block]["rates"][name]
        lines.append(f"| {label} | {_rate(rate)} | {rate['n']} |")
    measured = [
        one for block in dict.fromkeys(row[1] for row in ROWS) for one in blocks[block]["measured"]
    ]
    return "\n".join([*lines, "", measured_text(measured)])


def _rate(rate: Mapping[str, Any]) -> str:
    share, low, high = (100.0 * rate[key] for key in ("rate", "low", "high"))
    return f"{share:.1f} % ({low:.1f}-{high:.1f})"


MISSES = 40
"""How many misses of a block are listed; the rest are in its JSON."""


def report(document: dict[str, Any], suffix: str = ".md") -> str:
    """A score as a page: Markdown, or HTML for the suffix `.html`; as it is for `.json`."""
    if suffix == ".json":
        return json.dumps(document, indent=1) + "\n"
    blocks = report_blocks(document)
    return to_html(blocks, {}) if suffix == ".html" else to_markdown(blocks, {}, "")


def report_blocks(document: dict[str, Any]) -> list[Block]:
    """A score as parts of a page: all targets in one table, then each block's own."""
    figures = document["blocks"]
    blocks: list[Block] = [
        Heading("Hidden effects", 1),
        Paragraph(f"Seed {document['seed']}. {measured_text(measured_in(figures))}"),
        TextTable(
            "Rates with 95 % Wilson intervals",
            ["block", "figure", "measured", "target", "verdict"],
            [
                *(row for name, each in figures.items() for row in _rates(name, each)),
                _pooled(figures),
            ],
            2,
        ),
    ]
    for name, each in figures.items():
        blocks += [Heading(f"Block {name}"), *_own(each)]
    return blocks


def measured_in(blocks: Mapping[str, Any]) -> list[Measured]:
    """What the figures of blocks were measured with."""
    return [each for block in blocks.values() for each in block["measured"]]


def _rates(name: str, figures: dict[str, Any]) -> list[list[str]]:
    rows = [
        [name, label, percent(figure), *_verdict(figure)]
        for label, figure in figures["rates"].items()
    ]
    gap, sizes = figures["gap_closed"], figures["sizes"]
    for key, label in (("median", "median"), ("tenth_percentile", "tenth percentile")):
        if gap[key]["value"] is not None:
            value = f"{gap[key]['value']:.3f}, n {gap['n']}"
            rows.append(
                [name, f"gap closed on held-out trials, {label}", value, *_verdict(gap[key])]
            )
    error = sizes["median_error"]
    if error["value"] is not None:
        value = f"{100 * error['value']:.1f} %, n {sizes['covered']['n']}"
        rows.append([name, "fitted size, median error", value, *_verdict(error)])
    for kind, intervals in _intervals(figures).items():
        rows.append(
            [name, f"95 % intervals of {kind} hold", percent(intervals), *_verdict(intervals)]
        )
    return rows


def _intervals(figures: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Those of effects and of the models' own parameters, where a block has some."""
    # Figures of before parameters were counted have none.
    kinds = {"effects": figures["sizes"], "parameters": figures.get("parameters", {})}
    counted = {kind: each["covered"] for kind, each in kinds.items() if "covered" in each}
    return {kind: each for kind, each in counted.items() if each["n"]}


def _pooled(blocks: Mapping[str, Any]) -> list[str]:
    """The row of all intervals of all blocks."""
    every = [each for block in blocks.values() for each in _intervals(block).values()]
    hits, count = (sum(each[name] for each in every) for name in ("hits", "n"))
    figure = rate([True] * hits + [False] * (count - hits), COVERAGE)
    return ["all", "95 % intervals hold, pooled", percent(figure), *_verdict(figure)]


def _verdict(figure: dict[str, Any]) -> list[str]:
    if "target" not in figure:
        return ["", ""]
    return [figure["target"], {True: "met", False: "missed", None: "open"}[figure["met"]]]


def _own(figures: dict[str, Any]) -> list[Block]:
    seconds = figures["seconds"]
    text = f"{figures['n']} cases."
    if seconds["median"] is not None:
        text += f" A diagnosis took {seconds['median']:.1f} s (median), {seconds['most']:.1f} s"
        text += " at most."
    tables: list[tuple[Any, Any]] = [
        (figures["sizes"]["by_parameter"], _sizes),
        (figures.get("parameters", {}).get("by_parameter"), _held),
        (figures["misses"], _misses),
    ]
    return [Paragraph(text), *(table(some) for some, table in tables if some)]


def _sizes(parameters: dict[str, Any]) -> TextTable:
    rows = [
        [name, f"{100 * each['median_error']:.1f} %", percent(each["covered"])]
        for name, each in parameters.items()
    ]
    return TextTable("Fitted sizes", ["parameter", "median error", "intervals cover"], rows)


def _held(parameters: dict[str, Any]) -> TextTable:
    rows = [[name, percent(each)] for name, each in parameters.items()]
    return TextTable("The model's own parameters", ["parameter", "intervals hold"], rows)


def _misses(misses: list[dict[str, Any]]) -> TextTable:
    rows = [
        [
            str(miss["number"]),
            miss["hidden"],
            "" if miss["r"] is None else f"{miss['r']:.2f}",
            miss["said"],
        ]
        for miss in misses[:MISSES]
    ]
    title = f"Misses, {len(rows)} of {len(misses)}"
    return TextTable(title, ["case", "hidden", "r", "said"], rows, 4)
