"""Commands and options, read off the command-line programs themselves."""

from typing import Any

import typer.main

import benchmarks.__main__
import pma_gym.cli
from generators.text import code, table

PROGRAMS = {
    "pma-gym": ("pma-gym", pma_gym.cli.app),
    "benchmarks": ("python -m benchmarks", benchmarks.__main__.app),
}


def commands(program: str) -> str:
    """Every command of a program, with its arguments and options."""
    called, app = PROGRAMS[program]
    group: Any = typer.main.get_command(app)
    parts = []
    if group.params:
        parts.append(_command(called, group))
    parts += [_command(f"{called} {name}", command) for name, command in group.commands.items()]
    return "\n\n".join(parts)


def _command(called: str, command: Any) -> str:  # noqa: ANN401 - typer does not export its type
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
    usage = [
        called,
        *(p.name.upper() for p in arguments),
        *(f"{p.opts[0]} {p.name.upper()}" for p in options if p.required),
        *(["[OPTIONS]"] if any(not p.required for p in options) else []),
    ]
    text = " ".join((command.help or "").split())
    example = (command.epilog or "").removeprefix("Example: ")
    parts = [f"### {called}", text, f"```text\n{' '.join(usage)}\n```"]
    if command.params:
        rows = [[_names(p), _default(p), p.help or ""] for p in (*arguments, *options)]
        parts.append(table(["Argument", "Default", "What"], rows))
    if example:
        parts.append(f"```bash\n{example}\n```")
    return "\n\n".join(parts)


def _names(parameter: Any) -> str:  # noqa: ANN401
    if parameter.param_type_name == "argument":
        return code(parameter.name.upper())
    return " / ".join(code(name) for name in (*parameter.opts, *parameter.secondary_opts))


def _default(parameter: Any) -> str:  # noqa: ANN401
    if parameter.required:
        return "required"
    value = parameter.default
    if isinstance(value, bool):
        return code(("--" if value else "--no-") + parameter.name)
    return "" if value in (None, "") else code(getattr(value, "value", value))
