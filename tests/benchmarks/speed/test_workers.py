"""A worker answers by lines of JSON; one that dies, hangs or cannot start is told by name."""

import sys
from pathlib import Path

import pytest
import typer

from benchmarks.speed import client, install, starts
from benchmarks.speed.client import Client, StartError, WorkerError
from benchmarks.speed.loops import Missing, single, vector
from benchmarks.speed.measure import Measurement, Repetition
from benchmarks.speed.peers import PEERS
from benchmarks.speed.rows import Row
from benchmarks.speed.workers import serve_own

FAKE = """
import os, time
from benchmarks.speed.loops import Missing, Prepared

def counts(by):
    print("a library says hello")
    return Prepared(lambda: by, lambda: {"by": by})

def absent():
    raise Missing("no such thing here")

def fails():
    raise ValueError("two\\nlines")

def dies():
    def chunk():
        os.write(2, b"first\\nlast words\\n")
        os._exit(3)
    return Prepared(chunk)

def sleeps():
    return Prepared(lambda: time.sleep(60) or 1)

ROWS = {f.__name__: f for f in (counts, absent, fails, dies, sleeps)}
"""


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A worker on a module of its own, in a process of its own."""
    (tmp_path / "fake_worker.py").write_text(FAKE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    made = Client(Path(sys.executable), "fake_worker")
    yield made
    made.end()


def test_an_episode_that_ends_is_begun_anew():
    class Counts:
        def __init__(self):
            self.steps = self.resets = 0

        def reset(self):
            self.resets += 1

        def step(self, action):
            self.steps += 1
            return None, 0.0, self.steps % 10 == 0, self.steps % 10 == 5, {}

    environment = Counts()
    assert single(environment, range(20)).chunk() == 20
    assert (environment.steps, environment.resets) == (20, 5)
    assert vector(environment, [0], 4096).chunk() == 4096
    assert environment.steps == 21
    assert vector(environment, [0], 8).chunk() == 1024
    assert environment.steps == 21 + 128


def test_a_worker_measures_in_whole_chunks(fake):
    fake.prepare("a", "counts", {"by": 7})
    answer = fake.measure("a", 0.01)
    assert answer["seconds"] >= 0.01 and answer["steps"] % 7 == 0 and answer["facts"] == {"by": 7}
    assert fake.versions["python"] == sys.version.split()[0]


def test_what_cannot_be_measured_and_what_fails_leaves_the_worker_alive(fake):
    with pytest.raises(Missing, match="no such thing here"):
        fake.prepare("a", "absent", {})
    with pytest.raises(WorkerError, match="^ValueError: two lines$"):
        fake.prepare("b", "fails", {})
    fake.prepare("c", "counts", {"by": 1})


def test_a_worker_that_dies_says_its_last_words_and_is_started_anew(fake):
    with pytest.raises(WorkerError, match="its process ended with exit code 3: last words"):
        fake.prepare("a", "dies", {})
    fake.prepare("b", "counts", {"by": 1})
    assert fake.measure("b", 0.0)["steps"] == 1


def test_a_worker_that_hangs_is_ended(fake, monkeypatch):
    monkeypatch.setattr(client, "PREPARE_S", 0.3)
    monkeypatch.setattr(client, "_END_S", 0.1)
    fake.prepare("a", "counts", {"by": 1})
    process = fake._process
    with pytest.raises(WorkerError, match="took longer than 0.3 s to answer"):
        fake.prepare("b", "sleeps", {})
    assert process.poll() is not None


def test_a_worker_that_cannot_load_takes_only_its_own_rows(fake):
    made = Client(Path(sys.executable), "no_such_module")
    with pytest.raises(StartError, match="ModuleNotFoundError: No module named 'no_such_module'"):
        made.prepare("a", "a", {})
    rows = [Row(f"single/{name}", name, "classic", "counts", {"by": 1}) for name in "ab"]
    rows.append(Row("single/c", "c", "own", "counts", {"by": 1}))
    clients = {"classic": made, "own": fake}
    measurement = Measurement(rows, Repetition(2, 0.0), lambda peer: clients[peer.name])
    measurement.run()
    one, other, fine = measurement.rows.values()
    assert one.broke and other.broke
    assert "cannot be started: ModuleNotFoundError" in other.absence
    assert len(fine.rates) == 2 and not fine.absence


def test_an_installation_that_fails_leaves_the_others(monkeypatch, capsys):
    def fail(peer):
        if peer.name == "envpool":
            raise install.InstallError("ERROR: no wheel")

    monkeypatch.setattr(install, "install", fail)
    monkeypatch.setattr(type(PEERS["envpool"]), "is_ready", property(lambda peer: False))
    with pytest.raises(typer.Exit) as caught:
        install.main(["envpool", "gymnax"])
    assert caught.value.exit_code == 0
    printed = capsys.readouterr().out
    assert "EnvPool: left out, it could not be installed: ERROR: no wheel" in printed
    assert "gymnax: installed in .peers/gymnax" in printed
    assert "Left out: EnvPool. The benchmark runs without them." in printed


def test_a_peer_whose_pins_have_changed_is_installed_anew(tmp_path, monkeypatch):
    peer = PEERS["gymnax"]
    monkeypatch.setattr("benchmarks.speed.peers.FOLDER", tmp_path)
    assert not peer.is_ready and peer.python is None and "not installed" in peer.absence
    peer.home.mkdir()
    peer.stamp.write_text(peer.wanted)
    assert peer.is_ready and peer.python is not None
    peer.stamp.write_text("older pins")
    assert peer.python is None and "pins have changed" in peer.absence


def test_pips_reason_is_its_last_error():
    printed = "WARNING: a\nERROR: first\nERROR: No matching distribution found for x\nhint: y\n"
    assert install.reason(printed) == "ERROR: No matching distribution found for x"
    assert install.reason("") == "no reason given"


def test_two_processes_are_counted_together():
    made = serve_own.pair("pma_gym/IsokineticDisplacement-v0", 16)
    own = serve_own.PAIRED * 1024
    # In the first the other process may have just begun.
    assert own <= made.chunk() and own < made.chunk()
    assert made.facts()["right_hand_sides"] > 0


def test_a_start_is_a_process_that_steps_once(monkeypatch):
    name = "pma_gym/IsokineticDisplacement-v0"
    assert starts.start(name).chunk() == 1
    monkeypatch.setattr(starts, "FIRST_STEP", "import sys; raise ValueError(sys.argv[1])")
    with pytest.raises(RuntimeError, match=f"no first step: ValueError: {name}"):
        starts.start(name).chunk()
