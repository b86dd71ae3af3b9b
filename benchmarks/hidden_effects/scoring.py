"""Counts over all cases that have an answer: rates with Wilson's interval, gaps, sizes."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.verdicts import Outcome, compare

Z = 1.959964
"""Of a 95 % interval."""


def score(folder: Path) -> str:
    """Tables as text; the same as JSON in `folder/score.json`."""
    outcomes, unanswered = read(folder)
    document = {"unanswered": unanswered, **count(outcomes)}
    (folder / "score.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    return table(document)


def read(folder: Path) -> tuple[list[Outcome], list[str]]:
    """Outcomes of all cases, and names of those without an answer."""
    outcomes, unanswered = [], []
    for case in sorted((folder / "cases").glob("case_*")):
        answer = folder / "answers" / case.name
        if not (answer / "diagnosis.json").is_file():
            unanswered.append(case.name)
            continue
        truth = json.loads((folder / "truth" / f"{case.name}.json").read_text("utf-8"))
        outcome = compare(truth, json.loads((answer / "diagnosis.json").read_text("utf-8")))
        if (answer / "seconds.txt").is_file():
            outcome.seconds = float((answer / "seconds.txt").read_text("utf-8"))
        outcomes.append(outcome)
    return outcomes, unanswered


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


def rate(hits: Iterable[bool | None]) -> dict[str, Any]:
    """How many of those that count hit; None does not count."""
    counted = [hit for hit in hits if hit is not None]
    low, high = wilson(sum(counted), len(counted))
    share = sum(counted) / len(counted) if counted else None
    return {"rate": share, "low": low, "high": high, "hits": sum(counted), "n": len(counted)}


def count(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """All figures by block."""
    blocks: dict[str, Any] = {}
    for block in dict.fromkeys(outcome.block for outcome in outcomes):
        some = [outcome for outcome in outcomes if outcome.block == block]
        rates = {name: rate(hits) for name, hits in _rates(block, some).items()}
        verdicts = dict(Counter(outcome.verdict for outcome in some))
        blocks[block] = {"rates": rates, "verdicts": verdicts} | _amounts(some)
    return {"blocks": blocks, "effects": _effects(outcomes), "sizes": _sizes(outcomes)}


def _rates(block: str, some: Sequence[Outcome]) -> dict[str, list[bool | None]]:
    if block == "single":
        return {
            "named right": [o.right for o in some],
            "right or in its group": [o.near for o in some],
            "confidently wrong": [o.wrong for o in some],
            "detected": [o.detected for o in some],
            "a spurious second": [o.spurious for o in some],
        }
    if block == "pair":
        return {
            "both named": [o.hits == 2 for o in some],
            "at least one": [o.hits >= 1 for o in some],
            "at least one, or its group": [o.near for o in some],
            "a spurious third": [o.spurious for o in some],
            "detected": [o.detected for o in some],
        }
    if block == "unknown":
        return {
            "unknown": [o.verdict == "unknown" for o in some],
            "a false name": [o.verdict == "effect" for o in some],
            "detected": [o.detected for o in some],
        }
    return {
        "false alarm": [o.detected for o in some],
        "right parameters": [o.parameters for o in some],
    }


def _amounts(some: Sequence[Outcome]) -> dict[str, Any]:
    closed = [share for outcome in some for share in outcome.closed]
    seconds = [outcome.seconds for outcome in some if outcome.seconds is not None]
    return {
        "gap_closed": {
            "median": float(np.median(closed)) if closed else None,
            "tenth_percentile": float(np.percentile(closed, 10)) if closed else None,
            "n": len(closed),
        },
        "seconds": {
            "median": float(np.median(seconds)) if seconds else None,
            "most": max(seconds, default=None),
        },
    }


def _effects(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """By hidden effect of single and unknown cases: what they were taken for."""
    found: dict[str, Counter[str]] = {}
    for outcome in outcomes:
        if len(outcome.truth) == 1:
            said = "+".join(outcome.named) or outcome.verdict
            found.setdefault(outcome.truth[0], Counter())[said] += 1
    return {name: dict(said.most_common()) for name, said in sorted(found.items())}


def _sizes(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    errors: dict[str, list[float]] = {}
    covered: dict[str, list[bool]] = {}
    for outcome in outcomes:
        for path, error in outcome.size_errors.items():
            errors.setdefault(path, []).append(error)
            covered.setdefault(path, []).append(outcome.covered[path])
    every = [error for some in errors.values() for error in some]
    inside = [held for some in covered.values() for held in some]
    return {
        "median_error": float(np.median(every)) if every else None,
        "covered": rate(inside),
        "by_parameter": {
            path: {"median_error": float(np.median(some)), "covered": rate(covered[path])}
            for path, some in sorted(errors.items())
        },
    }


def table(document: dict[str, Any]) -> str:
    """The figures as text."""
    lines = [f"without an answer: {len(document['unanswered'])}"]
    for block, figures in document["blocks"].items():
        lines += ["", block]
        lines += [f"  {name:28s}{_shown(figure)}" for name, figure in figures["rates"].items()]
        lines.append(f"  verdicts: {_listed(figures['verdicts'])}")
        gap, seconds = figures["gap_closed"], figures["seconds"]
        if gap["n"]:
            lines.append(
                f"  gap closed: median {gap['median']:.3f}, tenth percentile "
                f"{gap['tenth_percentile']:.3f} (n {gap['n']})"
            )
        if seconds["median"] is not None:
            lines.append(f"  seconds: median {seconds['median']:.0f}, most {seconds['most']:.0f}")
    lines += ["", "what each was taken for"]
    lines += [f"  {name:26s}{_listed(said)}" for name, said in document["effects"].items()]
    sizes = document["sizes"]
    if sizes["median_error"] is not None:
        lines += ["", f"fitted sizes: median error {100 * sizes['median_error']:.1f} %"]
        lines.append(f"  95 % intervals cover {_shown(sizes['covered'])}")
        for path, figure in sizes["by_parameter"].items():
            error = f"{100 * figure['median_error']:.1f} %"
            lines.append(f"  {path:44s}{error:>9s}   covered {_shown(figure['covered'])}")
    return "\n".join(lines)


def _shown(figure: dict[str, Any]) -> str:
    if not figure["n"]:
        return "no case"
    low, high = 100 * figure["low"], 100 * figure["high"]
    share = 100 * figure["rate"]
    return f"{share:5.1f} % ({low:.1f}-{high:.1f}), {figure['hits']} of {figure['n']}"


def _listed(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {n}" for name, n in counts.items())
