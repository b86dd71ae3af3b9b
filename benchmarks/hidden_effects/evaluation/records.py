"""The record of a case that was drawn and diagnosed.

A record has the truth, the essentials of the answer, the time it took, and by which code it was
measured: the figures say whether the method is still the same.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

from benchmarks.files import say_damaged, write_text
from benchmarks.hidden_effects.generation.files import case_name
from benchmarks.runner.fingerprint import ROOT, digest_of
from benchmarks.runner.provenance import git_state
from pma_gym.document_shape import check_shape, shape_of
from pma_gym.documents import read_json

Measured = Mapping[str, str]
"""`commit`, `date` and `method`, the digest of the sources of `pma_gym/discovery`."""

UNKNOWN: Measured = dict.fromkeys(("commit", "date", "method"), "unknown")
"""Of a figure whose record does not say."""


def method_digest(root: Path = ROOT) -> str:
    """Digest of the diagnosis' sources in a clone."""
    return digest_of(sorted((root / "pma_gym" / "discovery").rglob("*.py")), root)[:16]


def measured_now() -> dict[str, str]:
    """What a figure that is measured now is stored with."""
    commit = str(git_state(ROOT)["commit"])[:8]
    return {"commit": commit, "date": date.today().isoformat(), "method": method_digest()}


def measured_text(some: Iterable[Measured], today: str | None = None) -> str:
    """Say in a sentence by which commits figures were measured, and whether the method is another.

    Args:
        some: what each figure was measured with.
        today: digest of the method; that of this clone if None.
    """
    distinct = sorted({(each["date"], each["commit"], each["method"]) for each in some})
    days: dict[str, list[str]] = {}
    for day, commit, _ in distinct:
        days.setdefault(day, []).append(f"`{commit}`")
    listed = "; ".join(f"{', '.join(commits)} on {day}" for day, commits in days.items())
    changed = {method for *_, method in distinct} != {today or method_digest()}
    return f"Measured by {listed}{'; **the method has changed since**' if changed else ''}."


CANDIDATES = 6
"""How many of the likeliest candidates are kept."""

ESSENTIALS = (
    *("verdict", "sentence", "effects", "gap", "not_identifiable", "blind", "warnings"),
    *("tones", "nuisances"),
)
"""What is kept whole of a `diagnosis.json`."""


@dataclass(frozen=True)
class CaseRecord:
    """A case that was drawn and judged.

    Attributes:
        number: of the case in its set.
        truth: what was hidden.
        answer: essentials of the diagnosis; None where it gave none.
        message: why it gave none.
        seconds: to draw it, to read and to diagnose it.
        code: fingerprint of the code that made it.
        measured: commit, date and method that answered it.
    """

    number: int
    truth: dict[str, Any]
    answer: dict[str, Any] | None
    message: str = ""
    seconds: dict[str, float] = field(default_factory=dict)
    code: str = ""
    measured: dict[str, str] = field(default_factory=lambda: dict(UNKNOWN))


_SHAPE = shape_of(CaseRecord)


def essentials(document: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept of a `diagnosis.json`: parameters that moved, the likeliest candidates."""
    moved = {path: each for path, each in document["parameters"].items() if each["significant"]}
    return {name: document[name] for name in ESSENTIALS} | {
        "parameters": moved,
        "candidates": document["candidates"][:CANDIDATES],
    }


def write(record: CaseRecord, folder: Path) -> None:
    """Keep a record in a folder; its file appears whole or not at all."""
    text = json.dumps(asdict(record), indent=1, allow_nan=False) + "\n"
    write_text(path_of(folder, record.number), text)


def read(folder: Path, count: int) -> list[CaseRecord]:
    """Records of a folder, of cases 1 to `count`, by number."""
    paths = [path_of(folder, number) for number in range(1, count + 1)]
    records, damaged = list[CaseRecord](), list[str]()
    for path in paths:
        if not path.is_file():
            continue
        try:
            entry = read_json(path, "journal_mib", own=True)
            check_shape(entry, _SHAPE)
            if path != path_of(folder, entry["number"]):
                raise ValueError(f"it is of case {entry['number']}")
            records.append(CaseRecord(**entry))
        except (ValueError, TypeError) as error:
            why = f"{error}".replace(f"{path} ", "").removesuffix("; write it anew")
            damaged.append(f"{path.name}: {why}")
    say_lost(folder, damaged)
    return records


def say_lost(folder: Path, damaged: Sequence[str]) -> None:
    """Say once which records of a folder are damaged, if any are."""
    if damaged:
        more = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
        say_damaged(
            folder / "cases",
            f"{damaged[0]}{more}",
            "those cases are computed anew, the others stay",
        )


def path_of(folder: Path, number: int) -> Path:
    """File of a case's record."""
    return folder / "cases" / f"{case_name(number)}.json"
