"""The command that designs controllers: which designs it makes, and what it says to slips."""

import re
import tomllib

import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.tuning import design as designing
from benchmarks.tuning.design import DesignError, DesignResult, problems_of, run_design
from controllers.design.designs import DESIGNS_FILE

TABLES = {
    "robust/displacement",
    "robust/rotation",
    "hard/displacement",
    "hard/rotation",
    "pressure/contraction",
}


@pytest.fixture
def searched(monkeypatch):
    """Names of the searches that ran, none of which takes time."""
    names = []

    def cheap(problem):
        names.append(problem.name)
        return DesignResult({"controller_bandwidth": 9.0}, 0.5, 1.0, f"loop_of_{problem.suite}")

    monkeypatch.setattr(designing, "design", cheap)
    return names


@pytest.fixture
def shipped(tmp_path):
    """A copy of the shipped designs."""
    out = tmp_path / "designs.toml"
    out.write_bytes(DESIGNS_FILE.read_bytes())
    return out


def test_every_controller_with_settings_is_designed_for_every_loop():
    problems = problems_of(["lqg", "mpc", "lqg"], 0)
    assert len(problems) == 2 * len(TABLES)
    assert {problem.name for problem in problems} == {
        f"{c}/{t}" for c in ("lqg", "mpc") for t in TABLES
    }


def test_what_the_file_has_is_left(searched, shipped, capsys):
    assert run_design(["adrc"], shipped, 0, 1, recompute=False)
    assert searched == []
    assert "has 5 of 5 designs asked for; --recompute makes them anew" in capsys.readouterr().out
    assert shipped.read_bytes() == DESIGNS_FILE.read_bytes()


def test_single_designs_are_made_anew_and_no_other_changes(searched, shipped):
    assert run_design(["adrc"], shipped, 7, 1, recompute=True, only="hard/rotation, pressure/*")
    assert searched == ["adrc/hard/rotation", "adrc/pressure/contraction"]
    before, after = (tomllib.loads(path.read_text()) for path in (DESIGNS_FILE, shipped))
    for suite, kind in (("hard", "rotation"), ("pressure", "contraction")):
        design = after["adrc"].pop(f"loop_of_{suite}")[kind]
        assert design["controller_bandwidth"] == 9.0
        assert f"{suite} version" in design["provenance"] and "seed 7," in design["provenance"]
    assert after == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--controllers", "lgq"), "got 'lgq'; there are lqg, .*; did you mean lqg[?]"),
        (("--controllers", "pid"), "got 'pid'; .* its gains are tuned: python -m benchmarks tune"),
        (
            ("--only", "hard/*,hrd/rotation"),
            "got 'hrd/rotation'; .*; did you mean hard/rotation[?]",
        ),
    ],
)
def test_slips_are_named_with_their_mend_and_nothing_runs(options, words, searched, shipped):
    done = CliRunner().invoke(app, ["design", "--recompute", "--out", str(shipped), *options])
    assert done.exit_code == 2
    assert done.stdout == "" and searched == []
    assert done.stderr.startswith(f"error: {options[0][2:]} must ")
    assert re.search(words, done.stderr)
    assert shipped.read_bytes() == DESIGNS_FILE.read_bytes()


def test_a_broken_file_is_named(searched, tmp_path):
    broken = tmp_path / "designs.toml"
    broken.write_text("{")
    with pytest.raises(DesignError, match=r"designs.toml is no file of settings .*name another"):
        run_design(["adrc"], broken, 0, 1, recompute=True)
    assert searched == []
