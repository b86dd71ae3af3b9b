"""The table of all baselines: rates on the same cases, with Wilson's intervals."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.baselines.answers import answer_file
from benchmarks.hidden_effects.baselines.registry import BASELINES
from benchmarks.hidden_effects.evaluation.measured import Measured
from benchmarks.hidden_effects.evaluation.scoring import rate
from benchmarks.hidden_effects.evaluation.verdicts import Outcome, compare
from pma_gym.documents import read_json

COLUMNS = (
    "detected",
    "named right",
    "right or in its group",
    "confidently wrong",
    "a spurious second",
    "alarm, nothing hidden",
    "effect claimed, parameters off",
    "unknown, outside the catalogue",
    "a false name, outside the catalogue",
)
"""The first five over cases of block single, two over those that hide no effect, two over those
that hide one which no catalogue has."""


def compared(folder: Path, baselines: Sequence[str]) -> dict[str, Any]:
    """Figures of each baseline that has answered, over the cases of a folder."""
    return {baseline: figures(*outcomes(folder, baseline)) for baseline in baselines}


def measured(folder: Path, baselines: Sequence[str]) -> list[Measured]:
    """What the answers of baselines were measured with, each once."""
    files = [file for name in baselines for file in answer_file(folder, name, "").parent.iterdir()]
    some = [read_json(file, "journal_mib", own=True, finite=False)["measured"] for file in files]
    return [each for place, each in enumerate(some) if each not in some[:place]]


def outcomes(folder: Path, baseline: str) -> tuple[list[Outcome], list[str]]:
    """A baseline's outcomes, and the cases about which it has said nothing."""
    answered, silent = [], []
    for path in sorted((folder / "truth").glob("case_*.json")):
        file = answer_file(folder, baseline, path.stem)
        answer: dict[str, Any] = (
            read_json(file, "journal_mib", own=True, finite=False)
            if file.is_file()
            else {"error": "not asked"}
        )
        if "error" in answer:
            silent.append(f"{path.stem}: {answer['error']}")
            continue
        outcome = compare(read_json(path, "journal_mib", own=True, finite=False), answer)
        outcome.seconds = answer["seconds"]
        answered.append(outcome)
    return answered, silent


def figures(some: Sequence[Outcome], silent: Sequence[str]) -> dict[str, Any]:
    """Rates of one baseline."""
    single = [each for each in some if each.block.startswith("single")]
    nothing = [each for each in some if each.block == "nothing"]
    parameters = [each for each in some if each.block == "parameters"]
    outside = [each for each in some if each.block == "unknown"]
    hits = (
        [each.detected for each in single],
        [each.right for each in single],
        [each.near for each in single],
        [each.wrong for each in single],
        [each.spurious for each in single],
        [each.detected for each in nothing],
        [each.detected for each in parameters],
        [each.verdict == "unknown" for each in outside],
        [each.verdict == "effect" for each in outside],
    )
    seconds = [each.seconds for each in some if each.seconds is not None]
    return {
        "rates": {name: rate(some) for name, some in zip(COLUMNS, hits, strict=True)},
        "seconds": float(np.median(seconds)) if seconds else None,
        "unanswered": list(silent),
    }


def table(document: dict[str, Any], left_out: dict[str, str]) -> str:
    """The figures as text: a block a column of rates, a line a baseline."""
    lines = []
    for column in COLUMNS:
        some = {baseline: each["rates"][column] for baseline, each in document.items()}
        if not any(figure["n"] for figure in some.values()):
            continue
        rows = (f"  {BASELINES[name].title:34s}{_shown(f)}" for name, f in some.items())
        lines += [column, *rows, ""]
    lines.append("median seconds a case")
    for baseline, each in document.items():
        seconds = "no answer" if each["seconds"] is None else f"{each['seconds']:.1f}"
        lines.append(f"  {BASELINES[baseline].title:34s}{seconds}")
    for baseline, each in document.items():
        title = BASELINES[baseline].title
        lines += [f"{title}: no answer to {words}" for words in each["unanswered"]]
    lines += [f"{BASELINES[name].title}: left out, {words}" for name, words in left_out.items()]
    return "\n".join(lines)


def _shown(figure: dict[str, Any]) -> str:
    if not figure["n"]:
        return "no case"
    low, high, share = (100.0 * figure[name] for name in ("low", "high", "rate"))
    return f"{share:5.1f} % ({low:.1f}-{high:.1f}), {figure['hits']} of {figure['n']}"
