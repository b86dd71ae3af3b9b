"""Build the wheel and sdist of `pma-gym-bench`: `python -m benchmarks.packaging.bench_wheel DIST`.

It holds controllers and benchmark as `pma_gym_controllers` and `pma_gym_benchmarks`, made from
the clone's folders, and the program `pma-gym-bench`. Its version, and that of the pma-gym that it
needs, are those of the clone.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pma_gym
from benchmarks.packaging.rename_packages import NAMES, renamed_source, renamed_strings

ROOT = Path(__file__).resolve().parents[2]
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
