"""Provenance of a run, stored beside its scores for reports.

Environment of a result, to reproduce it: versions, commit, machine.
"""

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks.files import say_damaged, write_text
from benchmarks.runner.case import Row
from benchmarks.runner.execution import PendingCases, row_identity
from benchmarks.runner.fingerprint import code_digest
from benchmarks.runner.journal import JOURNAL, case_rows
from benchmarks.suites.suite import Entry, FrozenSuite, SuiteError
from pma_gym.document_shape import ShapeError, Whole, check_shape
from pma_gym.documents import read_json

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


RUN, STATIONS = "run.json", "stations.json"
SCHEMA = 1

_KNOWN = {
    "suite?": {"name?": str, "digest?": str, "version?": Whole()},
    "contenders?": {"*": {"title": str, "source": str, "key": str}},
    "code?": str,
}
"""Shape of what another run needs of a `run.json`."""

_REPORTED = {
    "suite": {"name": str, "digest": str, "version": Whole()},
    "contenders": {"*": {"title": str, "source": str, "key": str, "command": str, "started": str}},
    "code": str,
    "git": dict,
    "versions": {"*": str},
    "platform": str,
    "processors": Whole(),
}
"""Shape of what a report says of a run."""


def check_folder(suite: FrozenSuite, out: Path) -> None:
    """Refuse a folder that cannot take a suite's results.

    Raises:
        SuiteError: it is a file, or has another suite's results.
    """
    if out.exists() and not out.is_dir():
        raise SuiteError(f"--out {out} is a file; name a folder for the results")
    name = read_run(out).get("suite", {}).get("name")
    if name not in (None, suite.name):
        raise SuiteError(f"--out {out} has results of suite {name}; name another folder")
    out.mkdir(parents=True, exist_ok=True)


def read_run(out: Path) -> dict[str, Any]:
    """Read the provenance of a folder's last run; empty if missing or damaged."""
    path = out / RUN
    if not path.exists():
        return {}
    try:
        document = read_json(path, "journal_mib", own=True)
        check_shape(document, _KNOWN)
    except ValueError as error:
        say_damaged(path, str(error), "a run writes it anew; sound rows of the journal stay")
        return {}
    return document


def check_run(out: Path, info: Mapping[str, Any], source: str) -> None:
    """Refuse what is known of a run if it lacks what a report says.

    Raises:
        SuiteError: what is missing, and how it is written anew.
    """
    try:
        check_shape(info, _REPORTED)
    except ShapeError as error:
        raise SuiteError(
            f"{out / RUN} is damaged ({error}); a run writes it anew: python -m benchmarks run "
            f"--suite {source}"
        ) from None


def finished_rows(out: Path) -> list[Row]:
    """The rows of a folder that belong together: made with one code, one version of the suite.

    They are those of the last run's controllers, and of earlier ones whose run had the same code;
    of a case that ran twice the later row.
    """
    keys = {name: entry["key"] for name, entry in read_run(out).get("contenders", {}).items()}
    rows = {
        row_identity(row): row
        for row in case_rows(out / JOURNAL)
        if row.get("key") is not None and keys.get(row.get("controller")) == row["key"]
    }
    return list(rows.values())


def run_info(todo: PendingCases, entries: Sequence[Entry], out: Path, jobs: int) -> dict[str, Any]:
    """Collect a run's provenance: resolved configuration, versions, commit, command."""
    suite = todo.suite
    return {
        "schema": SCHEMA,
        "suite": {
            "name": suite.name,
            "title": suite.title,
            "version": suite.version,
            "source": suite.source,
            "digest": suite.digest,
            "seed": suite.seed,
            "model": suite.model,
            "environment": dict(suite.environment),
            "stations": list(suite.stations),
            "recipe": asdict(suite.recipe) if suite.recipe else None,
            "episodes": [plan._asdict() for plan in suite.episode_plans],
        },
        "contenders": _controllers(todo, entries, out),
        "code": code_digest(),
        "jobs": jobs,
        **environment_info(),
    }


def _controllers(
    todo: PendingCases, entries: Sequence[Entry], out: Path
) -> dict[str, dict[str, str]]:
    """Title, source, key and command of those that are run, and of earlier ones of this code."""
    before, now = read_run(out), (code_digest(), todo.suite.digest)
    same = (before.get("code"), before.get("suite", {}).get("digest")) == now
    kept = before.get("contenders", {}) if same else {}
    command = {
        "command": shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]]),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    return kept | {
        entry.spec.name: {
            "title": entry.spec.label,
            "source": entry.spec.source,
            "key": todo.keys[entry.spec.name],
            **command,
        }
        for entry in entries
    }


def _stations(suite: FrozenSuite) -> list[dict[str, Any]]:
    """Every station of a suite, with every number."""
    entries = []
    for number in suite.stations:
        drawn = suite.station(number)
        entries.append(
            {
                "station": number,
                "effects": drawn.present,
                "refused_draws": drawn.refused,
                "parameters": {
                    name: drawn.model.values_in_files(name) for name in drawn.model.effects
                },
            }
        )
    return entries


def write_run(out: Path, info: Mapping[str, Any], **more: object) -> None:
    """Write what a run was made with."""
    write_text(out / RUN, _text({**info, **more}))


def write_stations(out: Path, suite: FrozenSuite) -> None:
    """Write every station of a suite with all its numbers."""
    write_text(out / STATIONS, _text(_stations(suite)))


def _text(document: object) -> str:
    return json.dumps(document, indent=1, allow_nan=False) + "\n"
