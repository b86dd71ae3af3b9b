"""Follow a page of docs/development: write its files and apply its diffs in a copy."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

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
