"""What all commands share: tables on the terminal, messages beside them, trials from files."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from pma_gym.data.trial import Trial
from pma_gym.data.trial_files import TrialWarning, read_trial


def console() -> Console:
    """Where tables go; as wide as they need where nobody watches."""
    found = Console()
    return found if found.is_terminal else Console(width=160)


def say(message: str) -> None:
    """A message that is no result."""
    print(message, file=sys.stderr)


@contextmanager
def warnings_said() -> Iterator[None]:
    """Says what reading trials passes over."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TrialWarning)
        yield
    for warning in caught:
        say(f"warning: {warning.message}")


def read(path: Path) -> Trial:
    """The trial in a file; what was passed over in it is said."""
    with warnings_said():
        return read_trial(path)
