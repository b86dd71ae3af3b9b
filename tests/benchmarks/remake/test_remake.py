"""The chain that makes anew what depends on the station: order and resumption."""

import io

import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.remake import Remake
from benchmarks.remake_steps import MODEL, Step, chain, content
from benchmarks.suites.versions import model_digest, raise_versions


class Machine:
    """Runs commands by writing them down; one of them may fail."""

    def __init__(self, fails=()):
        self.ran, self.fails = [], set(fails)

    def run(self, words):
        self.ran.append(words)
        return 3 if words in self.fails else 0


@pytest.fixture
def remake(tmp_path):
    ground = tmp_path / "model.toml"
    ground.write_text("first", encoding="utf-8")
    steps = [
        Step("gains", "gains", (("tune",),), (ground,), 1.0),
        Step("scores", "scores", (("run",), ("report",)), (ground,), 1.0),
    ]

    def made(machine):
        shown = Console(file=io.StringIO(), width=100)
        return Remake(steps, tmp_path / "out", shown, machine.run)

    made.ground = ground  # type: ignore[attr-defined]
    return made


def test_it_runs_in_order_and_what_is_done_stays_done(remake):
    machine = Machine()
    assert remake(machine).go()
    assert machine.ran == [("tune",), ("run",), ("report",)]
    assert remake(machine).go() and len(machine.ran) == 3
    assert remake(machine).left() == []


def test_a_command_that_fails_ends_it_and_the_next_run_goes_on_there(remake):
    machine = Machine(fails=[("report",)])
    assert not remake(machine).go()
    machine.fails.clear()
    machine.ran.clear()
    assert remake(machine).go()
    assert machine.ran == [("report",)]


def test_other_grounds_are_made_anew(remake):
    machine = Machine()
    remake(machine).go()
    remake.ground.write_text("second", encoding="utf-8")
    assert [step.name for step in remake(machine).left()] == ["gains", "scores"]


def test_the_chain_names_files_that_are_there():
    steps = chain()
    assert [step.name for step in steps][:4] == ["identify", "suites", "gains", "designs"]
    assert all(content(path) for step in steps[:5] for path in step.depends)
    assert MODEL in steps[2].depends and steps[2].digest != steps[3].digest


def test_another_model_gives_every_suite_a_new_version_once(tmp_path):
    (tmp_path / "robust.toml").write_text('name = "robust"\nversion = 7\n', encoding="utf-8")
    assert raise_versions(tmp_path, "one") == []
    assert raise_versions(tmp_path, "two") == ["robust 8"]
    assert raise_versions(tmp_path, "two") == []
    assert "version = 8" in (tmp_path / "robust.toml").read_text(encoding="utf-8")


def test_the_suites_go_with_the_shipped_station():
    """Who changes the station runs `python -m benchmarks remake --only suites`."""
    assert chain()[1].commands[0][1] == "benchmarks.suites.versions"
    from benchmarks.suites.versions import KEPT, SUITES

    assert (SUITES / KEPT).read_text(encoding="utf-8").strip() == model_digest()


def test_steps_are_listed_and_an_unknown_one_is_refused():
    done = CliRunner().invoke(app, ["remake", "--list"])
    assert done.exit_code == 0 and "policies" in done.stdout
    done = CliRunner().invoke(app, ["remake", "--only", "gain"])
    assert done.exit_code == 2 and "--only takes identify, suites, gains" in done.stderr
