"""Options, result folders and refusals that the commands share."""

import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from benchmarks.executors.choice import ExecutorName
from benchmarks.executors.executor import Executor, ExecutorMissing
from benchmarks.files import RESULTS  # noqa: F401 (the commands take it from here)

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


def refuse(error: Exception) -> NoReturn:
    """One message and exit code 2."""
    print(f"error: {error}", file=sys.stderr)
    raise typer.Exit(2)


def chosen_executor(name: ExecutorName, jobs: int) -> Executor:
    """The executor of `--executor`; refuses one that is not installed."""
    from benchmarks.executors.choice import executor_named

    try:
        return executor_named(name, jobs)
    except ExecutorMissing as error:
        refuse(error)


def require_writable(path: Path | None, option: str) -> None:
    """Refuse a file that cannot be written before anything is computed for it.

    Args:
        path: what was given; None if nothing was.
        option: that it was given by, for the message.
    """
    from pma_gym.files import OutputError, check_output

    try:
        if path is not None:
            check_output(path)
    except OutputError as error:
        refuse(ValueError(f"{option}: {error}"))


def writable_out(out: Path | None) -> Path | None:
    """The file of `--out` as it was given, if it can be written."""
    require_writable(out, "--out")
    return out


def listed(text: str) -> list[str]:
    """Split a text at commas."""
    return [part.strip() for part in text.split(",") if part.strip()]


_OUT = typer.Option(help="File to write, in a folder that exists.", callback=writable_out)
Out = Annotated[Path, _OUT]
OptionalOut = Annotated[Path | None, _OUT]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
ExecutorOption = Annotated[
    ExecutorName,
    typer.Option("--executor", help="Here, or at RAY_ADDRESS."),
]
LOCAL = ExecutorName.LOCAL
Recompute = Annotated[bool, typer.Option("--recompute", help="Compute anew what other code made.")]
