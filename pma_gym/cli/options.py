"""Command line parsing: strict numbers, no empty texts, the nearest option, and `--effect`."""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, NoReturn, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from pma_gym.documents import printable
from pma_gym.units import parse_number

_Option = type(typer.Option())

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


EffectOption = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE", help="Your file of effects; repeatable."),
]


class StrictTyper(typer.Typer):
    """Typer application with numbers parsed as in files: no `nan`, no `1_000`, no `٣`.

    An empty text is refused for every argument and option: it is what a shell makes of a variable
    that is not set.

    A command, or the program, with the option `--model` also has `--effect`, and runs its files
    before anything else.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"cls": _StrictGroup, **options})

    def command(self, *names: Any, **options: Any) -> Callable[..., Any]:
        """Typer's decorator, with strict numbers and texts, and `--effect`."""
        register = super().command(*names, **{"cls": _StrictCommand, **options})
        return lambda function: register(_with_effects(function))

    def callback(self, *names: Any, **options: Any) -> Callable[..., Any]:
        """Typer's decorator, with `--effect`."""
        register = super().callback(*names, **options)
        return lambda function: register(_with_effects(function))


def _with_effects(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--effect` to a function with the option `--model`."""
    hint = get_type_hints(function, include_extras=True).get("model")
    if not any(isinstance(each, _Option) for each in getattr(hint, "__metadata__", ())):
        return function

    @wraps(function)
    def run(*arguments: Any, effect: list[Path] | None, **named: Any) -> Any:  # noqa: ANN401
        for path in effect or ():
            # Imported here: who completes a word or asks for help waits for no catalogue.
            from pma_gym.effects.user_effects import load_effects

            load_effects(path)
        return function(*arguments, **named)

    signature = inspect.signature(function)
    added = inspect.Parameter(
        "effect", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=EffectOption
    )
    parameters = [*signature.parameters.values(), added]
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {**function.__annotations__, "effect": EffectOption}
    return run


class _Strict:
    """What a command and a group of them share."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        _make_strict(self)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401
        with _nearest_option(self):
            return super().parse_args(ctx, args)  # type: ignore[misc]


class _StrictCommand(_Strict, TyperCommand):
    """A command."""


class _StrictGroup(_Strict, TyperGroup):
    """A group of commands."""


@contextmanager
def _nearest_option(command: Any) -> Iterator[None]:  # noqa: ANN401
    """Name the nearest option of a command to one that it does not have."""
    try:
        yield
    except Exception as error:
        # Typer's own Click and the one it used before 0.20 have a class each.
        if type(error).__name__ != "NoSuchOption":
            raise
        visible = [param for param in command.params if not getattr(param, "hidden", False)]
        known = [name for param in visible for name in (*param.opts, *param.secondary_opts)]
        options = [name for name in (*known, "--help") if name.startswith("-")]
        option = error.option_name  # type: ignore[attr-defined]
        near = get_close_matches(option, options, 1)
        error.message = f"No such option: {printable(option[:60])}"  # type: ignore[attr-defined]
        error.message += f". Did you mean {near[0]}?" if near else ""  # type: ignore[attr-defined]
        error.possibilities = None  # type: ignore[attr-defined]
        raise


def _make_strict(command: Any) -> None:  # noqa: ANN401 - Typer brings its own Click since 0.20
    """Check the texts of a command before Python's `int`, `float` and `Path` read them."""
    callback = getattr(command.callback, "__wrapped__", command.callback)
    hints = get_type_hints(callback) if callback else {}
    for param in command.params:
        kinds = {hints.get(param.name), *get_args(hints.get(param.name))}
        numbers = int if int in kinds else float if float in kinds else None
        param.process_value = _checked(param.process_value, param, numbers)


def _checked(process: Callable[..., Any], param: Any, numbers: type | None) -> Callable[..., Any]:  # noqa: ANN401
    def refuse(ctx: Any, message: str) -> NoReturn:  # noqa: ANN401
        raise typer.BadParameter(message, ctx=ctx, param=param)

    def process_value(ctx: Any, value: Any) -> Any:  # noqa: ANN401
        texts = value if isinstance(value, list | tuple) else (value,)
        for text in filter(lambda each: isinstance(each, str), texts):
            if not text.strip() and ctx.get_parameter_source(param.name).name != "DEFAULT":
                omit = "" if param.required else f", or omit {param.opts[0]}"
                refuse(ctx, f"it is empty, like a shell variable that is not set; write it{omit}")
            if numbers and not _is_number(text, whole=numbers is int):
                kind, example = (
                    ("a whole number", "8") if numbers is int else ("a number", "1.5 or 1e-3")
                )
                shown = printable(text[:60])
                refuse(ctx, f"'{shown}' is not {kind}; write ASCII digits, such as {example}")
        return process(ctx, value)

    return process_value


def _is_number(text: str, whole: bool) -> bool:
    if parse_number(text) is None:
        return False
    return not whole or text.strip().removeprefix("-").removeprefix("+").isdigit()
