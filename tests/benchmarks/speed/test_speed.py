"""Rows are measured in rounds by processes of their own; what fails or is missing is named."""

import json
import os
import re

import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

import benchmarks.__main__
from benchmarks.speed import install, peers, run, worker
from benchmarks.speed.peers import ENVPOOL, GYMNAX, OWN, PEERS, Row, all_rows

CHECKED = {"single/own": 30.0, "single/CartPole": 10.0, "batch/own/1024": 100.0}
CHECKED |= {"batch/own_two/1024": 190.0, "batch/sync_Pendulum/1024": 5.0}
CHECKED |= {"single/joint": 15.0, "single/slide": 15.0, "single/valve_pair": 6.0}
CHECKED |= dict.fromkeys((f"batch/{rig}/1024" for rig in ("joint", "slide", "valve_pair")), 90.0)


def test_rows_peers_pins_and_targets_fit_together():
    rows = all_rows()
    keys = [row.key for row in rows]
    assert len(set(keys)) == len(keys)
    assert all(row.peer in (OWN, *PEERS) for row in rows)
    assert all(callable(getattr(worker, row.make)) for row in rows)
    for peer in PEERS:
        pins = peer.pins.read_text().split()
        assert all(re.fullmatch(r"[\w.-]+==[\w.]+", pin) for pin in pins) and pins
    for own, other, _ in run.TARGETS:
        assert own in keys and any(run.matches(key, other) for key in keys)


def test_rows_are_chosen_by_what_their_keys_begin_with():
    rows = all_rows()
    assert {row.key.split("/")[0] for row in run.select("single, plant", rows)} == {
        "single",
        "plant",
    }
    assert [row.key for row in run.select("single/own", rows)] == ["single/own"]
    assert run.select("", rows) == rows
    with pytest.raises(ValueError, match="--only: no row 'singel'; there are single/own, "):
        run.select("single,singel", rows)


def test_a_ratio_is_taken_within_rounds_against_the_fastest():
    # A slow second round slows both; medians of the rates alone would say 30 / 12.
    rates = {"single/own": {0: 30.0, 1: 3.0, 2: 40.0, 3: 9.0}, "single/gem_slow": {0: 1.0}}
    rates["single/gem_fast"] = {0: 12.0, 1: 1.0, 2: 20.0}
    assert run.ratio(("single/own", "single/gem_*", 2.0), rates) == [2.5, 3.0, 2.0]
    assert run.ratio(("single/own", "single/pcgym", 2.0), rates) == []


def test_an_environment_that_ends_is_reset_and_a_batch_takes_other_actions():
    class Counts:
        def __init__(self):
            self.actions, self.resets = [], 0

        def reset(self, seed=None):
            self.resets += 1

        def step(self, action):
            self.actions.append(action)
            steps = len(self.actions)
            return None, 0.0, steps % 10 == 0, steps % 10 == 5, {}

    one, batch = Counts(), Counts()
    assert worker.single(one, range(20))() == 20
    assert (one.actions, one.resets) == (list(range(20)), 5)
    chunk = worker.many(batch, [0, 1, 2], 1024)
    assert [chunk() for _ in range(4)] == [1024] * 4 and batch.actions == [0, 1, 2, 0]
    assert worker.measured(lambda: 7, 0.0)[0] == 7


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (Row("a/b", "b", OWN, "one", {"name": "CartPole-v1"}), ""),
        (Row("a/b", "b", OWN, "vector", {"name": peers.DISPLACEMENT, "count": 2}), ""),
        *((row, "") for row in all_rows() if row.key in map("single/{}".format, peers.RIGS)),
        (Row("a/b", "b", OWN, "one", {"name": "Nothing-v1"}), "exit code 1: .*Nothing"),
        (Row("a/b", "b", OWN, "one", {"threads": 99999}), "needs 99999 cores"),
        (Row("a/b", "b", GYMNAX, "gymnax"), "gymnax is not installed .*`make peers`"),
    ],
)
def test_a_row_is_measured_or_says_why_not(monkeypatch, tmp_path, row, message):
    monkeypatch.setattr(peers, "FOLDER", tmp_path)
    if not message:
        assert run.measure(row, 0.01) > 0.0
        return
    with pytest.raises(run.Absent, match=message):
        run.measure(row, 0.01)


def test_a_row_that_hangs_is_ended(monkeypatch):
    monkeypatch.setattr(run, "LONGEST_S", 0.05)
    with pytest.raises(run.Absent, match=r"longer than 0\.05 s"):
        run.measure(Row("a/b", "b", OWN, "one", {"name": "CartPole-v1"}), 9.0)


def given_rates(monkeypatch, rates, interrupt_after=99):
    calls = []

    def measure(row, seconds):
        if len(calls) == interrupt_after:
            raise KeyboardInterrupt
        calls.append(row.key)
        if row.key not in rates:
            raise run.Absent("not in this test")
        return rates[row.key]

    monkeypatch.setattr(run, "measure", measure)
    return calls


def speed(*arguments):
    return CliRunner().invoke(benchmarks.__main__.app, ["speed", *map(str, arguments)])


@pytest.mark.parametrize(
    ("rates", "cores", "failed"),
    [
        (CHECKED, 2, ""),
        (CHECKED | {"single/CartPole": 20.0}, 2, "single/own over single/CartPole"),
        (CHECKED | {"single/valve_pair": 4.9}, 2, "single/valve_pair over single/CartPole"),
        (CHECKED | {"batch/own_two/1024": 110.0}, 2, "batch/own_two/1024 over batch/own/1024"),
        (CHECKED | {"batch/own_two/1024": 110.0}, 1, ""),
        (CHECKED | {"batch/sync_Pendulum/1024": 6.0}, 2, "over batch/sync_Pendulum/1024"),
        ({k: v for k, v in CHECKED.items() if k != "single/CartPole"}, 2, "over single/CartPole"),
    ],
)
def test_a_check_fails_where_a_ratio_falls_short_or_is_not_measured(
    monkeypatch, capsys, rates, cores, failed
):
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    calls = given_rates(monkeypatch, rates)
    assert run.run_speed(check=True, quick=True, console=Console(quiet=True)) == bool(failed)
    assert failed in capsys.readouterr().err and set(calls) == set(CHECKED)


@pytest.mark.parametrize("place", ["absent/x.json", "."])
def test_a_file_that_cannot_be_written_is_refused_before_anything_runs(
    tmp_path, monkeypatch, place
):
    monkeypatch.setattr(run, "measure", lambda *_: pytest.fail("it ran"))
    done = speed("--json", tmp_path / place)
    assert done.exit_code == 2 and re.match(r"error: --json: cannot write .*folder", done.output)
    assert speed("--only", "nothing").exit_code == 2


def test_every_round_measures_every_row_and_is_written(tmp_path, monkeypatch):
    calls = given_rates(monkeypatch, CHECKED)
    done = speed("--quick", "--only", "single", "--json", tmp_path / "speed.json")
    assert done.exit_code == 0 and "Left out: single/pcgym: not in this test" in done.output
    assert calls.count("single/own") == 2 and calls.count("single/pcgym") == 1
    written = json.loads((tmp_path / "speed.json").read_text())
    assert written["per_second"]["single/own"] == {"0": 30.0, "1": 30.0} and written["git"]


def test_an_interrupt_tells_what_was_measured_and_leaves_the_last_run(tmp_path, monkeypatch):
    given_rates(monkeypatch, CHECKED, interrupt_after=11)
    path = tmp_path / "speed.json"
    path.write_text("earlier")
    done = speed("--quick", "--only", "single", "--json", path)
    assert done.exit_code == 130 and "Interrupted" in done.output
    assert "30" in done.output and path.read_text() == "earlier"


def test_an_installation_that_fails_leaves_the_others(tmp_path, monkeypatch, capsys):
    def fail(peer):
        if peer is ENVPOOL:
            raise install.InstallError("ERROR: no wheel")

    monkeypatch.setattr(install, "install", fail)
    monkeypatch.setattr(peers, "FOLDER", tmp_path)
    with pytest.raises(typer.Exit) as caught:
        install.main(["envpool", "gymnax"])
    assert caught.value.exit_code == 0
    printed = capsys.readouterr().out
    assert "EnvPool: left out, it could not be installed: ERROR: no wheel" in printed
    assert "gymnax: installed" in printed and "Left out: EnvPool." in printed
    assert install.reason("WARNING: a\nERROR: no match for x\nhint: y\n") == "ERROR: no match for x"


def test_a_peer_whose_pins_have_changed_is_installed_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "FOLDER", tmp_path)
    assert GYMNAX.python is None
    GYMNAX.home.mkdir()
    GYMNAX.stamp.write_bytes(GYMNAX.pins.read_bytes())
    assert GYMNAX.python == GYMNAX.interpreter
    GYMNAX.stamp.write_text("older pins")
    assert GYMNAX.python is None
