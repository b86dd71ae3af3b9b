"""Fingerprint of what a row was computed with: a row is reused only if it agrees."""

import hashlib
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.suites.suite import FrozenSuite
from pma_gym.effects.user_effects import loaded_digest

ROOT = Path(__file__).resolve().parents[2]

SOURCES = (
    "pma_gym/**/*.py",
    "pma_gym/**/*.toml",
    "pma_gym/**/*.csv",
    "controllers/**/*.py",
    "controllers/design/*.toml",
    "benchmarks/runner/rollout.py",
    "benchmarks/runner/controller_spec.py",
    "benchmarks/suites/reproduction.py",
    "benchmarks/executors/executor.py",
    "benchmarks/executors/local.py",
    "benchmarks/runner/isolated_controller.py",
    "benchmarks/suites/stations.py",
    "benchmarks/runner/case.py",
    "benchmarks/runner/figures.py",
    "benchmarks/runner/phase_score.py",
    "benchmarks/suites/stations.py",
    "benchmarks/suites/frozen.py",
    "benchmarks/suites/suite.py",
)
"""Files that a figure may depend on. Pages and statistics are made from rows, and are not here."""

VERSIONED = ("numpy", "scipy", "control", "osqp", "llvmlite", "gymnasium")
"""Packages whose versions a figure may depend on."""


def key(suite: FrozenSuite, spec: ControllerSpec) -> str:
    """Fingerprint of everything that a controller's rows of a suite depend on.

    The suite's numbers, this repository's code, the packages' versions, for a controller of
    somebody's own its file, for a policy its files. What such a file imports or reads besides is
    not looked at.
    """
    parts = [suite.name, str(suite.version), suite.digest, code_digest(), spec.name]
    if spec.files:
        parts.append(digest_of(spec.files))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


@cache
def code_digest() -> str:
    """Digest of the repository's code, of the packages' versions and of the user's effects."""
    files = sorted(path for pattern in SOURCES for path in ROOT.glob(pattern))
    versions = [f"{name} {_version(name)}" for name in VERSIONED]
    parts = [digest_of(files), *versions, *filter(None, [loaded_digest()])]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def code_digest_with(files: Sequence[Path]) -> str:
    """`code_digest` and the contents of more files, in this order: of a job's own code."""
    digest = hashlib.sha256(code_digest().encode())
    for path in files:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "missing"


def digest_of(files: Sequence[Path], root: Path = ROOT) -> str:
    """Digest of files, of their contents and of their names below a folder."""
    digest = hashlib.sha256()
    for path in files:
        content = path.read_bytes()
        name = path.relative_to(root) if path.is_relative_to(root) else path.name
        digest.update(f"{name} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()
