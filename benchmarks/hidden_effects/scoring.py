"""Placeholder."""

from pathlib import Path


def score(folder: Path) -> str:
    """Placeholder."""
    return str(folder)
