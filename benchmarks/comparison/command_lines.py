"""Commands that messages name, such that they work as they stand in the folder of the user."""

import shlex
from pathlib import Path

from benchmarks.files import RESULTS
from benchmarks.suites.suite import FrozenSuite


def run_command(suite: FrozenSuite, folder: Path) -> str:
    """Return the command that runs a suite into a folder.

    >>> from benchmarks.suites.frozen import frozen_suite
    >>> run_command(frozen_suite("nominal"), Path("results/nominal"))
    'python -m benchmarks run --suite nominal'
    >>> run_command(frozen_suite("nominal"), Path("my results"))
    "python -m benchmarks run --suite nominal --out 'my results'"
    """
    return _joined("run", "--suite", suite.source, *_folder("--out", suite, folder))


def report_command(suite: FrozenSuite, folder: Path) -> str:
    """Return the command that writes the report of a folder."""
    return _joined("report", suite.source, *_folder("--results", suite, folder))


def remove_command(name: str, suite: FrozenSuite, folder: Path) -> str:
    """Return the command that removes a controller's rows from a folder's journal."""
    results = [] if folder.parent == RESULTS else ["--results", str(folder.parent)]
    return _joined("remove", name, "--suite", suite.source, *results)


def _folder(option: str, suite: FrozenSuite, folder: Path) -> list[str]:
    return [] if folder == RESULTS / suite.name else [option, str(folder)]


def _joined(*arguments: str) -> str:
    return shlex.join(["python", "-m", "benchmarks", *arguments])
