"""Gives a suite a new version where what it draws its stations from is another than it was.

`benchmarks/suites/model.txt` keeps the digest of the model that the suites' versions go with. By
the suites' own rule a change that moves a figure is a new version; a model's numbers move all.
"""

import hashlib
import re
from pathlib import Path

from benchmarks.files import write_text
from benchmarks.runner.fingerprint import ROOT
from pma_gym.plant.model import load_model

SUITES = ROOT / "benchmarks" / "suites"
KEPT = "model.txt"
_VERSION = re.compile(r"^version = (\d+)$", re.MULTILINE)


def model_digest(model: str = "station") -> str:
    """Digest of a model's numbers and intervals, not of the words about them."""
    loaded = load_model(model)
    numbers = [f"{path} {note.low} {note.high}" for path, note in loaded.notes.items()]
    text = "\n".join([repr(dict(loaded.parameters)), *sorted(numbers)])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def raise_versions(folder: Path = SUITES, digest: str | None = None) -> list[str]:
    """Raise the version of every suite of a folder if the model is another; names of those raised.

    Args:
        folder: of the suites' files, and of the digest that they go with.
        digest: of the model; the shipped station's if not given.
    """
    now, kept = digest or model_digest(), folder / KEPT
    if kept.is_file() and kept.read_text(encoding="utf-8").strip() == now:
        return []
    raised = []
    for path in sorted(folder.glob("*.toml")) if kept.is_file() else []:
        text = path.read_text(encoding="utf-8")
        match = _VERSION.search(text)
        if match:
            new = f"version = {int(match[1]) + 1}"
            write_text(path, text[: match.start()] + new + text[match.end() :])
            raised.append(f"{path.stem} {new.removeprefix('version = ')}")
    # Last: whoever is interrupted before raises again what was raised, never too little.
    write_text(kept, now + "\n")
    return raised


if __name__ == "__main__":
    print(", ".join(raise_versions()) or "no suite needs a new version")
