"""Functions for all commands: tables on the terminal, messages, trials from files."""

import json
import math
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.table import Table

from pma_gym.data.files.trial_files import TrialWarning, read_trial
from pma_gym.data.trial import Trial
from pma_gym.pages.document import TextTable
from pma_gym.terminal import SafeConsole, table_console


def console() -> SafeConsole:
    """Console for tables; as wide as needed if the output is not a terminal."""
    return table_console()


def print_table(table: TextTable) -> None:
    """Print a table on the terminal."""
    shown = Table(*table.header, title=table.title)
    for row in table.rows:
        shown.add_row(*row)
    console().print(shown)


def print_json(document: object) -> None:
    """Print a document for programs; numbers that JSON lacks, such as infinity, are null."""
    print(json.dumps(_finite(document), indent=1, allow_nan=False))


def _finite(document: Any) -> Any:  # noqa: ANN401 - whatever JSON has
    if isinstance(document, dict):
        return {str(key): _finite(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [_finite(value) for value in document]
    return None if isinstance(document, float) and not math.isfinite(document) else document


def say(message: str) -> None:
    """Print a message that is not a result, to stderr."""
    print(message, file=sys.stderr)


@contextmanager
def warnings_said() -> Iterator[None]:
    """Print the warnings of reading trials."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TrialWarning)
        yield
    for warning in caught:
        say(f"warning: {warning.message}")


@contextmanager
def warnings_said_at_once(kind: type[Warning]) -> Iterator[None]:
    """Print warnings of a kind at once; others are handled as before."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", kind)
        show = warnings.showwarning

        def shown(message: Warning | str, category: type[Warning], *where: Any) -> None:
            if issubclass(category, kind):
                say(f"warning: {message}")
            else:
                show(message, category, *where)

        warnings.showwarning = shown  # type: ignore[assignment]
        yield


def read(path: Path) -> Trial:
    """Read the trial in a file, and print its warnings."""
    with warnings_said():
        return read_trial(path)
