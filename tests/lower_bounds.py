"""Lower bounds of the requirements: as constraints to install by, and compared with what is there.

python tests/lower_bounds.py constraints > constraints.txt
python tests/lower_bounds.py check
"""

import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

TOOLS = ("docs", "dev")
"""Extras of what this project is made with, not of what it runs with: any version serves users."""

_FORM = re.compile(r"(?P<name>[A-Za-z0-9._-]+)(?:\[[^]]*\])?\s*(?P<versions>[^;]*)")


def requirements(tools: bool = False) -> list[tuple[str, str, str]]:
    """Extra, name and lower bound of each requirement; "" where there is none.

    Args:
        tools: those of the project's tools too.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"": project["dependencies"], **project["optional-dependencies"]}
    every = []
    for extra, lines in groups.items():
        if tools or extra not in TOOLS:
            every += [(extra, *_parsed(line)) for line in lines]
    return every


def _parsed(line: str) -> tuple[str, str]:
    match = _FORM.match(line)
    assert match is not None, line
    bound = re.search(r">=\s*([0-9][0-9A-Za-z.]*)", match["versions"])
    return match["name"], bound.group(1) if bound else ""


def is_version(installed: str, bound: str) -> bool:
    """Whether a version is a bound: 2.4.0+cpu is 2.4."""
    plain = installed.partition("+")[0].split(".")
    wanted = bound.split(".")
    length = max(len(plain), len(wanted))
    return plain + ["0"] * (length - len(plain)) == wanted + ["0"] * (length - len(wanted))


def main() -> int:
    """Print constraints, or what is installed and is not at its bound."""
    bounds = sorted({(name, bound) for _, name, bound in requirements()})
    if sys.argv[1:] == ["constraints"]:
        print("\n".join(f"{name}=={bound}" for name, bound in bounds))
        return 0
    wrong = [
        f"{name} is {metadata.version(name)}, its lower bound is {bound}"
        for name, bound in bounds
        if not is_version(metadata.version(name), bound)
    ]
    print("\n".join(wrong or [f"{len(bounds)} requirements are at their lower bounds"]))
    return len(wrong)


if __name__ == "__main__":
    sys.exit(main())
