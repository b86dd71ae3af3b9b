"""Options, result folders and refusals that the commands share."""

import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from benchmarks.executors.choice import ExecutorName
from benchmarks.executors.executor import ExecutorMissing
from pma_gym.cli.options import StrictTyper

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


def refuse(error: Exception) -> NoReturn:
    """One message and exit code 2."""
    print(f"error: {error}", file=sys.stderr)
    raise typer.Exit(2)


class Program(StrictTyper):
    """Commands that end in one message where an order cannot be carried out, or after Ctrl-C."""

    def command(self, *names: Any, **options: Any) -> Callable[..., Any]:
        """See `StrictTyper`."""
        register = super().command(*names, **options)
        return lambda function: register(_ending_in_words(function))

    def callback(self, *names: Any, **options: Any) -> Callable[..., Any]:
        """See `StrictTyper`."""
        register = super().callback(*names, **options)
        return lambda function: register(_ending_in_words(function))


def _ending_in_words(function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def run(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401
        try:
            return function(*arguments, **named)
        except (ExecutorMissing, ValueError) as error:
            refuse(error)
        except KeyboardInterrupt:
            print("Interrupted; the same command again goes on from what is kept", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None

    return run


app = Program(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    invoke_without_command=True,
)
"""The program, to which the modules beside this one add their commands."""


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
EnvironmentOption = Annotated[
    str,
    typer.Option(help="With --model: options as TOML, or its file."),
]
LOCAL = ExecutorName.LOCAL
Recompute = Annotated[bool, typer.Option("--recompute", help="Compute anew what other code made.")]
