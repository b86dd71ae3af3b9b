"""Rounds of all rows, and the command: what is missing or interrupted is told by name."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

import benchmarks.__main__
from benchmarks.speed import measure, page, run
from benchmarks.speed.loops import Missing
from benchmarks.speed.measure import Measurement, Repetition
from benchmarks.speed.report.tables import speed_tables
from benchmarks.speed.rows import Row, all_rows, select

ROOT = Path(__file__).parents[3]


class CpuDevice:
    """Measures nothing: rates by key, numbered calls."""

    versions = {"python": "3"}

    def __init__(self, rates=(), interrupt_after=None):
        self.rates, self.calls, self.ended = dict(rates), [], 0
        self.interrupt_after = interrupt_after

    def prepare(self, key, row, settings):
        if key not in self.rates:
            raise Missing("not in this test")

    def measure(self, key, seconds):
        if len(self.calls) == self.interrupt_after:
            raise KeyboardInterrupt
        self.calls.append(key)
        return {"steps": self.rates[key], "seconds": 1.0, "facts": {"right_hand_sides": 400.0}}

    def end(self):
        self.ended += 1


def cpu_library(monkeypatch, rates, **options):
    made = CpuDevice(rates, **options)
    monkeypatch.setattr(measure, "client_of", lambda peer: made)
    return made


def test_every_round_measures_every_row_once_in_another_order():
    rows = [Row(f"single/{name}", name, "own", "one") for name in "abcdef"]
    orders = []
    for _ in range(2):
        made = CpuDevice({row.key: 1.0 for row in rows})
        measurement = Measurement(rows, Repetition(3, 0.0), lambda peer, made=made: made)
        done = []
        measurement.run(done.append)
        rounds = [tuple(made.calls[i : i + 6]) for i in (0, 6, 12)]
        assert all(sorted(order) == [row.key for row in rows] for order in rounds)
        assert len(set(rounds)) == 3
        assert len(done) == measurement.work and measurement.complete and made.ended
        orders.append(rounds)
    assert orders[0] == orders[1]


def test_rows_that_belong_together_are_measured_one_after_the_other():
    rows = [Row(f"single/{name}", name, "own", "one") for name in "abcdefgh"]
    keys = [row.key for row in rows]
    groups = [keys[1:3], keys[4:7]]
    made = CpuDevice(dict.fromkeys(keys, 1.0))
    Measurement(rows, Repetition(20, 0.0), lambda peer: made, groups).run()
    rounds = [made.calls[i : i + 8] for i in range(0, 160, 8)]
    neighbours = set()
    for calls in rounds:
        assert sorted(calls) == keys
        for group in groups:
            first = min(map(calls.index, group))
            beside = calls[first : first + len(group)]
            assert sorted(beside) == group
            neighbours.add(tuple(beside))
    # In any order among themselves.
    assert len(neighbours) == 2 + 6


def test_single_environments_are_measured_in_a_new_process_each_round():
    keys = ["single/own", "batch/own/64", "single/CartPole"]
    workers = []

    def client(peer):
        workers.append(CpuDevice(dict.fromkeys(keys, 1.0)))
        return workers[-1]

    rows = [row for row in all_rows() if row.key in keys]
    measurement = Measurement(rows, Repetition(3, 0.0), client)
    measurement.run()
    assert measurement.complete
    by_keys = {tuple(set(worker.calls)): worker.ended for worker in workers}
    assert by_keys == {("single/own",): 3, ("batch/own/64",): 1, ("single/CartPole",): 3}


def test_missing_peers_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.speed.peers.FOLDER", tmp_path)
    rows = select("single/pcgym,plant/dompc,batch/gymnax_CartPole", all_rows())
    measurement = Measurement(rows, Repetition(1, 0.0), lambda peer: None)
    measurement.run()
    report = run.document(measurement, [], {"git": {}}, 0.0)
    (absent,) = (table for table in speed_tables(report) if table.name == "absent")
    what, why = zip(*absent.rows, strict=True)
    assert set(why) == {"not installed; `make peers` installs it"}
    assert "PC-gym reactor" in what and "do-mpc simulator (CVODES)" in what
    assert any(text.startswith("gymnax CartPole (1, 4, 16,") for text in what)


def test_rows_that_need_more_cores_are_left_out_and_excused(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    rates = {"batch/own/1024": 9.0, "single/own": 1.0, "single/own_kernel": 1.0}
    cpu_library(monkeypatch, rates)
    assert run.run_speed(check=True, quick=True, console=Console(quiet=True)) == 0


def speed(*arguments):
    return CliRunner().invoke(benchmarks.__main__.app, ["speed", *map(str, arguments)])


@pytest.mark.parametrize("place", ["absent/x.json", "."])
def test_a_file_that_cannot_be_written_is_refused_before_anything_runs(
    tmp_path, monkeypatch, place
):
    monkeypatch.setattr(Measurement, "run", lambda *_: pytest.fail("it ran"))
    done = speed("--json", tmp_path / place)
    assert done.exit_code == 2
    assert re.match(r"error: --json: cannot write .*folder", done.output)
    assert not list(tmp_path.iterdir())


def test_rows_that_do_not_exist_are_refused(monkeypatch):
    monkeypatch.setattr(Measurement, "run", lambda *_: pytest.fail("it ran"))
    done = speed("--only", "nothing")
    assert done.exit_code == 2 and "error: --only: no row 'nothing'" in done.output


def test_a_run_is_written_whole(tmp_path, monkeypatch):
    cpu_library(monkeypatch, {"single/own": 180.0, "single/CartPole": 100.0})
    path = tmp_path / "speed.json"
    done = speed("--quick", "--only", "single", "--json", path)
    assert done.exit_code == 0, done.output
    assert "single: CartPole-v1" in done.output and "met" in done.output
    written = json.loads(path.read_text())
    assert written["complete"] and written["schema"] == 1
    assert {"git", "versions", "processor", "processors", "command"} <= set(written["run"])
    (own,) = (row for row in written["rows"] if row["key"] == "single/own")
    assert [one["per_second"] for one in own["rounds"]] == [180.0, 180.0]
    assert written["ratios"][0]["median"] == 1.8
    (pcgym,) = (row for row in written["rows"] if row["key"] == "single/pcgym")
    assert pcgym["left_out"] == "not in this test" and pcgym["median"] is None


def test_an_interrupt_tells_what_was_measured_and_leaves_the_last_whole_run(tmp_path, monkeypatch):
    rates = {"single/own": 180.0, "single/CartPole": 100.0}
    made = cpu_library(monkeypatch, rates, interrupt_after=3)
    path = tmp_path / "speed.json"
    path.write_text("earlier")
    done = speed("--quick", "--only", "single", "--json", path)
    assert done.exit_code == 130
    assert "Interrupted" in done.output and "single: CartPole-v1" in done.output
    assert made.ended and path.read_text() == "earlier"
    assert not json.loads((tmp_path / "speed.partial.json").read_text())["complete"]


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc to see children")
def test_ctrl_c_ends_the_workers():
    command = [sys.executable, "-m", "benchmarks", "speed", "--only", "single/CartPole"]
    with subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A test run in the background ignores Ctrl-C, and its children would inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        workers = wait_for_workers(process)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "Interrupted" in output and "Traceback" not in errors
    assert workers
    # A worker that outlived its parent by a moment stands in /proc until init has collected it.
    patience = time.monotonic() + 5.0
    while any(Path(f"/proc/{worker}").exists() for worker in workers):
        assert time.monotonic() < patience, "a worker runs on"
        time.sleep(0.05)


def wait_for_workers(process):
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and process.poll() is None:
        tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
        children = [child for task in tasks for child in task.read_text().split()]
        contents = [
            child
            for child in children
            if b"serve_classic" in Path(f"/proc/{child}/cmdline").read_bytes()
        ]
        if contents:
            return contents
        time.sleep(0.05)
    return []


@pytest.mark.parametrize(
    ("rates", "code", "message"),
    [
        ({"batch/own/1024": 100, "batch/own_two/1024": 190}, 0, ""),
        ({"batch/own/1024": 40, "batch/own_two/1024": 76}, 1, "against the kernel of one: 1.60"),
        ({"batch/own/1024": 100, "batch/own_two/1024": 110}, 1, "two threads against one"),
        ({"batch/own/1024": 100}, 1, "not measured: pma-gym, 2 threads: not in this test"),
    ],
)
def test_a_check_fails_where_a_ratio_falls_short_or_is_not_measured(
    monkeypatch, capsys, rates, code, message
):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    cpu_library(monkeypatch, {"single/own_kernel": 25, "single/own": 10} | rates)
    assert run.run_speed(check=True, quick=True, console=Console(quiet=True)) == code
    errors = capsys.readouterr().err
    assert message in errors and errors.count("failed:") == code


def test_the_page_takes_its_figures_from_a_whole_run(tmp_path, monkeypatch):
    cpu_library(monkeypatch, {"single/own": 180.0, "single/CartPole": 100.0})
    path = tmp_path / "speed.json"
    assert speed("--quick", "--only", "single", "--json", path).exit_code == 0
    with pytest.raises(page.RunError, match="no whole run"):
        page.load_run(path)
    with pytest.raises(page.RunError, match="there is no file"):
        page.load_run(tmp_path / "none.json")
    text = "".join(each.read_text(encoding="utf-8") for each in page.PAGES)
    refreshed_text = page.refreshed(text, json.loads(path.read_text()))
    assert "| CartPole-v1 | 20 ms; 4 states, one Euler step | 100 | 0 % |" in refreshed_text
    assert f"<!-- figures: batches -->\n\n{page.ABSENT}" in refreshed_text
    assert page.refreshed(refreshed_text, json.loads(path.read_text())) == refreshed_text
    assert set(re.findall(r"figures: (\w+)", text)) >= {"setting", "ratios", "absent"}
