"""The numbers by which the diagnosis decides, and those of its numerics, from their docstrings."""

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pma_gym
from generators.text import code, table

_ROOT = Path(pma_gym.__file__).parent / "discovery"


def decision_numbers(module: str) -> str:
    """Decision numbers of a method.

    Args:
        module: below `pma_gym/discovery`, without `.py`.
    """
    return table(["Number", "Value", "Meaning"], _numbers(_ROOT / f"{module}.py"))


def numerics() -> str:
    """Numbers of the numerics, by module: starts, grids, sample sizes, windows and tolerances."""
    paths = (path.relative_to(_ROOT) for path in sorted(_ROOT.glob("*/**/*.py")))
    rows = (
        [code(path.with_suffix("").as_posix()), *row]
        for path in paths
        if path.parts[0] != "report" and path.name != "thresholds.py"
        for row in _numbers(_ROOT / path)
        if not row[1].startswith("`{")
    )
    return table(["Module", "Number", "Value", "Meaning"], rows)


def _numbers(path: Path) -> Iterator[list[str]]:
    for stated, text in pairwise(ast.parse(path.read_text(encoding="utf-8")).body):
        match stated, text:
            case ast.Assign([name], value), ast.Expr(ast.Constant(str(meaning))):
                parts = (part for part in ast.walk(value) if isinstance(part, ast.Constant))
                if any(isinstance(part.value, int | float) for part in parts):
                    words = [ast.unparse(name).strip("()"), ast.unparse(value)]
                    yield [*map(code, words), " ".join(meaning.split())]
