"""Build the wheel and sdist of `pma-gym-bench`: `python -m benchmarks.bench_wheel DIST`.

It holds controllers and benchmark as `pma_gym_controllers` and `pma_gym_benchmarks`, made from
the clone's folders, and the program `pma-gym-bench`. Its version, and that of the pma-gym that it
needs, are those of the clone.
"""

import io
import re
import shutil
import subprocess
import sys
import tempfile
import tokenize
from pathlib import Path

import pma_gym

NAMES = {"controllers": "pma_gym_controllers", "benchmarks": "pma_gym_benchmarks"}
"""Names in a clone, and in the wheel."""

_OLD = "|".join(NAMES)
_IMPORT = re.compile(rf"^(\s*(?:from|import)\s+)({_OLD})(?=[\s.,])", re.MULTILINE)
_BARE = re.compile(rf"^\s*import\s+({_OLD})(?:\.[\w.]+)?\s*$", re.MULTILINE)
_PATH = re.compile(rf"(?<![\w./-])({_OLD})(?=(?:\.[a-z_]\w*|/[\w*]|:[A-Z]))")
_PROGRAM = re.compile(r"(python -m )(benchmarks)\b")


def renamed_source(text: str) -> str:
    """Python source in which the packages have their names of the wheel.

    >>> print(renamed_source("from controllers.pid import PID"))
    from pma_gym_controllers.pid import PID
    >>> print(renamed_source('name = "controllers.pid:PID"'))
    name = "pma_gym_controllers.pid:PID"
    >>> print(renamed_source('controllers = {"controllers": 1}'))
    controllers = {"controllers": 1}
    """
    text = "".join(_renamed_tokens(text, {match[1] for match in _BARE.finditer(text)}))
    return _IMPORT.sub(lambda match: match[1] + NAMES[match[2]], text)


def renamed_strings(text: str) -> str:
    """Text, such as YAML, in which modules and paths have their names of the wheel."""
    text = _PROGRAM.sub(lambda match: match[1] + NAMES[match[2]], text)
    return _PATH.sub(lambda match: NAMES[match[1]], text)


def _renamed_tokens(text: str, used: set[str]) -> list[str]:
    """The text in pieces: strings renamed, and attributes of packages that are imported whole."""
    lines = text.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    pieces, at = [], 0
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    strings = {tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}
    for token, following in zip(tokens, tokens[1:], strict=False):
        begin = starts[token.start[0] - 1] + token.start[1]
        end = starts[token.end[0] - 1] + token.end[1]
        if token.type in strings and token.string.strip("\"'") in NAMES:
            # A name alone is a package only where a program is started: "-m", "benchmarks".
            name = token.string.strip("\"'")
            started = re.search(r"""["']-m["'],\s*$""", text[:begin])
            new = token.string.replace(name, NAMES[name]) if started else None
        elif token.type in strings:
            new = renamed_strings(text[begin:end])
        elif token.type == tokenize.NAME and token.string in used and following.string == ".":
            new = NAMES[token.string] if not text[:begin].rstrip(" ").endswith(".") else None
        else:
            new = None
        if new is not None:
            pieces += [text[at:begin], new]
            at = end
    return [*pieces, text[at:]]


ROOT = Path(__file__).resolve().parents[1]
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "packaging")
_PYPROJECT = """\
[build-system]
requires = ["hatchling>=1.27"]
build-backend = "hatchling.build"

[project]
name = "pma-gym-bench"
version = "{version}"
description = "Controllers and benchmark of pma-gym, for those who have no clone of it"
readme = "README.md"
license = "MIT"
license-files = ["LICENSE"]
authors = [{{ name = "pma-gym contributors" }}]
requires-python = ">=3.11"
dependencies = ["pma-gym[bench,mpc,policies]=={version}"]

[project.scripts]
pma-gym-bench = "pma_gym_benchmarks.__main__:main"

[tool.hatch.build.targets.wheel]
packages = ["pma_gym_controllers", "pma_gym_benchmarks"]
"""
_README = """\
# pma-gym-bench

Controllers and benchmark of pma-gym: `import pma_gym_controllers`, `pma-gym-bench --help`. In a
clone of pma-gym the same packages are called `controllers` and `benchmarks`; pages and examples use
those names.
"""


def write_tree(folder: Path) -> None:
    """Write the source tree that the distribution is built from.

    Args:
        folder: an empty folder.
    """
    for old, new in NAMES.items():
        shutil.copytree(ROOT / old, folder / new, ignore=_LEFT_OUT)
        for path in (folder / new).rglob("*"):
            rename = {".py": renamed_source, ".yml": renamed_strings}.get(path.suffix)
            if rename:
                path.write_text(rename(path.read_text(encoding="utf-8")), encoding="utf-8")
    pyproject = _PYPROJECT.format(version=pma_gym.__version__)
    (folder / "pyproject.toml").write_text(pyproject, encoding="utf-8")
    (folder / "README.md").write_text(_README, encoding="utf-8")
    shutil.copy(ROOT / "LICENSE", folder / "LICENSE")


def build(dist: Path) -> None:
    """Build wheel and sdist into a folder; pip fetches the build backend."""
    with tempfile.TemporaryDirectory() as folder:
        write_tree(Path(folder))
        command = [sys.executable, "-m", "build", "--outdir", str(dist.resolve()), folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
