"""Environment of a result, to reproduce it: versions, commit, machine."""

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("numpy", "scipy", "llvmlite", "gymnasium", "pma_gym")


def environment_info() -> dict[str, object]:
    """Versions of Python and of the packages that figures depend on, commit and machine."""
    versions = {name: metadata.version(name.replace("_", "-")) for name in PACKAGES}
    return {
        "versions": {"python": platform.python_version(), **versions},
        "git": git_state(ROOT),
        "platform": platform.platform(),
        "processors": os.cpu_count(),
    }


def git_state(folder: Path) -> dict[str, object]:
    """Commit of the clone in a folder, and whether files differ from it.

    Returns:
        `commit` and `dirty`; "unknown" and None where the folder is no clone's root, or git is
        missing.
    """
    top = _git(folder, "rev-parse", "--show-toplevel")
    commit = _git(folder, "rev-parse", "HEAD")
    # A copy inside somebody else's repository has not that repository's commit.
    if not top or not commit or Path(top).resolve() != folder.resolve():
        return {"commit": "unknown", "dirty": None}
    return {"commit": commit, "dirty": bool(_git(folder, "status", "--porcelain"))}


def _git(folder: Path, *arguments: str) -> str | None:
    """What git says; None if it fails or is not installed."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=20
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
