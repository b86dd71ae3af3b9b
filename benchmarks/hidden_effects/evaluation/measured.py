"""By which code a figure was measured, and whether the method is still the same."""

from collections.abc import Iterable, Mapping
from datetime import date
from pathlib import Path

from benchmarks.runner.fingerprint import ROOT, digest_of
from benchmarks.runner.provenance import git_state

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
