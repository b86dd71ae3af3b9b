"""What is kept of a case: the truth, the essentials of the answer, how long it took."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.files import write_text
from benchmarks.hidden_effects.files import case_name

CANDIDATES = 6
"""How many of the likeliest candidates are kept."""

ESSENTIALS = ("verdict", "sentence", "effects", "gap", "not_identifiable", "blind", "warnings")
"""What is kept whole of a `diagnosis.json`."""


@dataclass(frozen=True)
class Record:
    """A case that was drawn and judged.

    Attributes:
        number: of the case in its set.
        truth: what was hidden.
        answer: essentials of the diagnosis; None where it gave none.
        message: why it gave none.
        rounds: what came of experiments that followed, by who chose them.
        seconds: to draw it, to read and to diagnose it.
        code: fingerprint of the code that made it.
        most_rounds: how many experiments could follow.
    """

    number: int
    truth: dict[str, Any]
    answer: dict[str, Any] | None
    message: str = ""
    rounds: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    code: str = ""
    most_rounds: int = 0


def essentials(document: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept of a `diagnosis.json`: parameters that moved, the likeliest candidates."""
    moved = {path: each for path, each in document["parameters"].items() if each["significant"]}
    return {name: document[name] for name in ESSENTIALS} | {
        "parameters": moved,
        "candidates": document["candidates"][:CANDIDATES],
        "next_experiment": document["next_experiment"],
    }


def write(record: Record, folder: Path) -> None:
    """Keep a record in a folder; its file appears whole or not at all."""
    text = json.dumps(asdict(record), indent=1, allow_nan=False) + "\n"
    write_text(path_of(folder, record.number), text)


def read(folder: Path, count: int | None = None) -> list[Record]:
    """Records of a folder, cases 1 to `count`, all if not given, by number."""
    if count is None:
        paths = sorted((folder / "cases").glob("case_*.json"))
    else:
        paths = [path_of(folder, number) for number in range(1, count + 1)]
    return [Record(**json.loads(path.read_text("utf-8"))) for path in paths if path.is_file()]


def path_of(folder: Path, number: int) -> Path:
    """File of a case's record."""
    return folder / "cases" / f"{case_name(number)}.json"
