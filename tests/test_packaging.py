"""What is shipped: one version, a demonstration without a clone, a second wheel of other names."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import pma_gym
from benchmarks.bench_wheel import renamed_source, renamed_strings, write_tree
from pma_gym import demo
from pma_gym.data.serres2008 import load_table

ROOT = Path(__file__).resolve().parent.parent


def test_the_version_has_one_place():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "pma_gym/__init__.py"
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {pma_gym.__version__}\n" in citation
    newest = re.search(r"^## \[(\d[^\]]*)\]", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert newest and newest[1] == pma_gym.__version__
    archive = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    assert archive["version"] == pma_gym.__version__
    assert archive["license"] == "MIT" and f"\nlicense: {archive['license']}\n" in citation
    # Zenodo refuses an upload without these.
    assert all(archive[key] for key in ("title", "upload_type", "description", "creators"))


def test_the_demonstration_prints_two_numbers_and_draws_them(tmp_path, capsys):
    assert demo.main([str(tmp_path / "demo.png")]) == 0
    printed = capsys.readouterr().out
    simulated, measured = map(float, re.findall(r"RMSE (\d\.\d\d) mm", printed))
    assert measured == load_table("22").where(pressure_kpa=300)["rmse_mm"][0]
    # The simulated station follows the printed voltages about as well as the real one did.
    assert 0.3 * measured < simulated < 1.5 * measured
    assert (tmp_path / "demo.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("arguments", [["demo.txt"], ["a.png", "b.png"], ["no/where.png"]])
def test_a_picture_that_cannot_be_written_ends_in_one_message(arguments, capsys, monkeypatch):
    monkeypatch.setattr(demo, "demonstrate", None)
    assert demo.main(arguments) == 2
    assert capsys.readouterr().err.startswith("error: ")


def test_the_line_drawn_is_the_measured_one():
    shown = demo.demonstrate(150)
    assert shown.measured_line == pytest.approx((5.2561355, -0.823263))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            "import controllers.pid\nx = controllers.pid.PID",
            "import pma_gym_controllers.pid\nx = pma_gym_controllers.pid.PID",
        ),
        ("from benchmarks import files", "from pma_gym_benchmarks import files"),
        ('run("-m", "benchmarks", *rest)', 'run("-m", "pma_gym_benchmarks", *rest)'),
        ('f"python -m benchmarks {x}"', 'f"python -m pma_gym_benchmarks {x}"'),
        ('ROOT / "controllers/**/*.py"', 'ROOT / "pma_gym_controllers/**/*.py"'),
        ('suite["controllers"]', 'suite["controllers"]'),
        ("controllers.strip()", "controllers.strip()"),
        ("suite.controllers.pid", "suite.controllers.pid"),
    ],
)
def test_packages_are_renamed_and_nothing_else(old, new):
    assert renamed_source(old) == new


def test_text_that_names_modules_is_renamed():
    assert renamed_strings("- benchmarks.training.a:") == "- pma_gym_benchmarks.training.a:"


@pytest.mark.campaign
def test_the_second_wheels_tree_runs_without_the_clones_names(tmp_path):
    """Its modules import each other by their own names, and one trial is scored."""
    write_tree(tmp_path)
    code = (
        "import sys; sys.modules['controllers'] = sys.modules['benchmarks'] = None\n"
        "from pma_gym_benchmarks.__main__ import main\n"
        "sys.argv[1:] = ['--controllers', 'pid', '--task', 'displacement', '--pressures', '300',"
        " '--jobs', '1', '--out', 'score']\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "score" / "report.html").exists()
