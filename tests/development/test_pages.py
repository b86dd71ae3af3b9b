"""The pages for developers name files and folders that exist, and layers in their order."""

import ast
import re
import tomllib

import pytest

from tests.development.drill import BLOCK, ROOT

PAGES = sorted((ROOT / "docs" / "development").glob("*.md"))
PATH = re.compile(r"`((?:pma_gym|controllers|benchmarks|tests|docs)/[\w./-]*)`")


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_every_path_exists(page):
    text = page.read_text(encoding="utf-8")
    added = {name for _, name, _ in BLOCK.findall(text)}
    paths = set(PATH.findall(text)) - added
    assert [name for name in sorted(paths) if not (ROOT / name).exists()] == []


def test_the_diagram_has_the_layers_of_the_contract():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = next(
        each["layers"] for each in contracts["tool"]["importlinter"]["contracts"]
        if each["id"] == "layers"
    )  # fmt: skip
    drawn = (ROOT / "docs" / "images" / "architecture.svg").read_text(encoding="utf-8")
    boxes = re.findall(r'font-weight="bold"[^>]*>([^<]+)<', drawn)
    contract = [re.sub(r"[()]", "", layer) for layer in layers]
    at_bottom = contract.index("codegen") + 1
    assert boxes[: at_bottom + 2] == ["benchmarks", "controllers", *contract[:at_bottom]]


LONG = 60
ROW = re.compile(r"^\| `([\w./]+\.py)` `(\w+)` \|", re.MULTILINE)


def long_functions(path):
    """Names of a file's functions of more than 60 lines."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if node.end_lineno - node.lineno + 1 > LONG:
                yield node.name


def test_long_functions_stand_on_the_page_with_their_reason():
    page = (ROOT / "docs" / "development" / "architecture.md").read_text(encoding="utf-8")
    listed = sorted(ROW.findall(page))
    there = sorted(
        (path.relative_to(ROOT).as_posix(), name)
        for package in ("pma_gym", "controllers", "benchmarks")
        for path in (ROOT / package).rglob("*.py")
        for name in long_functions(path)
    )
    assert listed == there
