"""The pages that say how to add something work as they stand, and touch three or four files.

Follow a page of docs/development: write its files and apply its diffs in a copy.

The pages for developers name files and folders that exist, and layers in their order.
"""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r'^```(\w+) title="([^"]+)"\n(.*?)^```$', re.MULTILINE | re.DOTALL)


def follow(page: str, copy: Path) -> list[str]:
    """Do what a page says in a copy of the repository.

    Args:
        page: name of a page of docs/development.
        copy: the copy's root.
    Returns:
        Paths that were touched, in the page's order.
    """
    text = (ROOT / "docs" / "development" / page).read_text(encoding="utf-8")
    blocks = BLOCK.findall(text)
    for language, name, content in blocks:
        path = copy / name
        if language == "diff":
            path.write_text(patched(path.read_text(encoding="utf-8"), content), encoding="utf-8")
        else:
            assert not path.exists(), f"{name} is there already: the page must add a file"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content, encoding="utf-8")
    return [name for _, name, _ in blocks]


def patched(text: str, diff: str) -> str:
    """A text after a diff whose context stands in it exactly once."""
    lines = diff.splitlines()
    before = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("+"))
    after = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("-"))
    assert text.count(before) == 1, f"the diff's context must stand once in the file:\n{before}"
    return text.replace(before, after)


def copied(folder: Path, *names: str) -> Path:
    """A copy of folders and files of the repository."""
    for name in names:
        source, target = ROOT / name, folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            # With the bytecode, which is still that of what a page leaves as it is.
            skip = shutil.ignore_patterns("*.safetensors")
            shutil.copytree(source, target, ignore=skip)
        else:
            shutil.copy(source, target)
    return folder


def run_pytest(copy: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """What pytest says in a copy, whose packages come before the installed ones."""
    environment = os.environ | {"PYTHONPATH": str(copy)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=500
    )


@pytest.mark.campaign
def test_a_controller_is_three_files(tmp_path):
    copy = copied(
        tmp_path, "controllers", "pyproject.toml", "docs/reference/controllers.md",
        "tests/contracts/test_controllers.py",
    )  # fmt: skip
    contract = ("tests/contracts/test_controllers.py", "-k", "proportional")
    before = run_pytest(copy, *contract)
    assert "deselected" in before.stdout and "passed" not in before.stdout
    touched = follow("add-a-controller.md", copy)
    assert touched == [
        "controllers/proportional.py", "controllers/registry.py", "docs/reference/controllers.md",
    ]  # fmt: skip
    after = run_pytest(copy, *contract)
    assert after.returncode == 0, after.stdout + after.stderr
    assert "3 passed" in after.stdout


CATALOGUE = ("tests/effects/conftest.py", "tests/effects/test_catalogue.py")


@pytest.mark.parametrize(
    ("page", "files", "copies", "asked", "least"),
    [
        # The page's own tests, and the contracts that loop over every effect or task.
        pytest.param(
            *("add-an-effect.md", 3, CATALOGUE),
            *(["tests/effects", "-k", "guide_lubricant or lubricant_force"], 8),
            marks=pytest.mark.campaign,
        ),
        (
            *("add-a-task.md", 3, ["tests/test_tasks.py"]),
            *(["tests/test_tasks.py", "tests/tasks", "-k", "smooth_step"], 4),
        ),
        pytest.param(
            *("add-a-rig.md", 3, (), ["tests/plant/test_vertical_slide.py"], 4),
            marks=pytest.mark.campaign,
        ),
        pytest.param(
            *("add-a-sensor.md", 4, CATALOGUE),
            *(["tests/plant", "tests/effects", "-k", "torque_flange"], 6),
            marks=pytest.mark.campaign,
        ),
    ],
)
def test_what_a_page_adds_is_three_or_four_files(page, files, copies, asked, least, tmp_path):
    copy = copied(tmp_path, "pma_gym", "pyproject.toml", *copies)
    assert len(set(follow(page, copy))) == files
    done = run_pytest(copy, *asked)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split(" passed")[0].split()[-1]) >= least


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
