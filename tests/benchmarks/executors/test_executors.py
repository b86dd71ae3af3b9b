"""Work on several processes: a death costs its own piece alone, Ctrl-C ends all at once."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from benchmarks.executors.choice import ExecutorName, executor_named, local
from benchmarks.executors.executor import (
    ProcessDied,
    ThisProcess,
    TookTooLong,
    run_all,
    run_or_raise,
)
from benchmarks.executors.local import LocalProcesses
from benchmarks.runner.controller_spec import ControllerSpec
from benchmarks.runner.execution import execute, pending_cases
from benchmarks.suites.frozen import load_suite
from tests.benchmarks.executors.pieces import (
    awkward,
    dies_once,
    exits,
    kills_itself,
    loops,
    raises,
    sleeps,
    squared,
)

ROOT = Path(__file__).parents[3]

DEADLY = """
import os
class Deadly:
    name = "deadly"
    def reset(self, reference, station):
        if round(station.pressure / 1e3) == 300:
            os._exit(3)
    def act(self, observation, time):
        return 1.0
"""

SLEEPERS = """
import sys, time
from functools import partial
from pathlib import Path
from benchmarks.executors.executor import run_all
from benchmarks.executors.local import LocalProcesses

def sleeper(folder, index):
    if index:
        (folder / str(index)).touch()
        time.sleep(600)
    return index

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    works = [partial(sleeper, folder, index) for index in range(4)]
    done = run_all(works, LocalProcesses(2), lambda index, _: print("done", index, flush=True))
    print(done, flush=True)
"""


def run(works, jobs=2):
    results = {}
    assert run_all(works, local(jobs), results.__setitem__)
    return results


def test_only_the_piece_whose_process_dies_is_lost():
    works = [partial(abs, -1), partial(exits, 3), kills_itself, *[int] * 4, partial(exits, 0)]
    results = run(works)
    assert results[0] == 1 and [results[index] for index in range(3, 7)] == [0] * 4
    assert isinstance(results[1], ProcessDied) and results[1].exit_code == 3
    assert "its process died, and again when it ran alone: exit code 3; look for" in str(results[1])
    assert results[2].exit_code == -9
    assert "exit code -9, killed by SIGKILL; mostly for want of memory" in str(results[2])
    # An orderly exit code is a death too.
    assert isinstance(results[7], ProcessDied)


def test_a_piece_that_dies_once_is_run_again(tmp_path):
    assert run([partial(dies_once, tmp_path / "marker"), int, int]) == {0: "alive", 1: 0, 2: 0}


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_raised_is_the_result(jobs):
    results = run([partial(raises, ValueError("bad")), partial(raises, SystemExit(7)), int], jobs)
    assert isinstance(results[0], ValueError) and str(results[0]) == "bad"
    assert isinstance(results[1], SystemExit) and results[2] == 0


def test_what_cannot_travel_costs_its_own_piece_alone():
    local = lambda: 1  # noqa: E731
    results = run([local, awkward, threading.Lock, int])
    assert isinstance(results[0], Exception) and isinstance(results[2], TypeError)
    assert str(results[1]) == "Awkward: one two"
    assert results[3] == 0


def test_a_case_whose_process_dies_fails_alone(tmp_path):
    path = tmp_path / "deadly.py"
    path.write_text(DEADLY)
    spec = ControllerSpec("Deadly", path=str(path))
    pressures = (300, 350)
    suite = load_suite().select(["serres2008"], [spec], ["displacement"], pressures)
    rows = []
    todo = pending_cases(suite, suite.entries, tmp_path)
    assert execute(todo, LocalProcesses(1), tmp_path, rows.append)
    failures = {row["pressure_kpa"]: row["failure"] for row in rows}
    assert [p for p, failure in failures.items() if failure] == [300]
    assert "its process died" in failures[300] and "exit code 3" in failures[300]


def test_ctrl_c_ends_what_is_in_progress_at_once(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SLEEPERS)
    with subprocess.Popen(
        [sys.executable, str(script), str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A test run in the background ignores Ctrl-C, and its children would inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        deadline = time.monotonic() + 60
        while len(list(tmp_path.glob("[12]"))) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        # Its processes hold the pipe too: it ends when the last of them has.
        try:
            output, _ = process.communicate(timeout=30)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert output.splitlines() == ["done 0", "False"]
    assert not (tmp_path / "3").exists()


@pytest.mark.campaign
def test_a_piece_that_takes_too_long_is_ended_and_the_others_are_not():
    results = {}
    works = [loops, partial(squared, 3), partial(exits, 3), partial(squared, 4)]
    executor = LocalProcesses(2, 5.0, "thinking")
    assert run_all(works, executor, results.__setitem__, untrusted=True)
    assert results[1] == 9 and results[3] == 16
    assert isinstance(results[0], TookTooLong)
    assert str(results[0]).startswith("thinking took over 5 s and was ended; look for an endless")
    # Of works that are not trusted none is run twice.
    assert isinstance(results[2], ProcessDied) and "again" not in str(results[2])


def test_works_that_must_succeed_raise_their_first_error():
    with pytest.raises(ValueError, match="bad"):
        run_or_raise([int, partial(raises, ValueError("bad"))], ThisProcess(), lambda *_: None)


ORPHANS = """
import sys
from functools import partial
from pathlib import Path
from benchmarks.executors.choice import ExecutorName, executor_named
from benchmarks.executors.executor import run_all
from tests.benchmarks.executors.pieces import sleeps

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    works = [partial(sleeps, folder, index, 600.0) for index in range(2)]
    try:
        run_all(works, executor_named(ExecutorName(sys.argv[2]), 2), lambda *result: print(result))
    except OSError as error:
        print(error)
"""


def is_alive(pid):
    """Whether a process runs; one that is dead and not yet reaped does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


def parent_of(pid):
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def children(pid):
    every = [int(path.name) for path in Path("/proc").glob("[0-9]*")]
    return [each for each in every if is_alive(each) and parent_of(each) == pid]


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.campaign
@pytest.mark.parametrize("part", ["gcs_server", "raylet"])
def test_a_ray_cluster_that_is_lost_is_said_to_be(tmp_path, part):
    pytest.importorskip("ray")
    script = tmp_path / "script.py"
    script.write_text(ORPHANS.replace("600.0", "12.0").replace("range(2)", "range(4)"))
    environment = {k: v for k, v in os.environ.items() if k != "RAY_ADDRESS"}
    with subprocess.Popen(
        [sys.executable, str(script), str(tmp_path), ExecutorName.RAY],
        env=environment | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as driver:
        deadline = time.monotonic() + 120
        while len(list(tmp_path.glob("*.pid"))) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        (node,) = (
            pid
            for pid in children(driver.pid)
            if Path(f"/proc/{pid}/comm").read_text().strip() == part
        )
        os.kill(node, signal.SIGKILL)
        output, _ = driver.communicate(timeout=60)
    # No piece is blamed.
    assert "ProcessDied" not in output
    assert "is lost; what is done stays: start the cluster again" in output


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize(
    ("name", "how"),
    [
        *[(name, signal.SIGKILL) for name in ExecutorName],
        *[(name, signal.SIGTERM) for name in ExecutorName if name is not ExecutorName.RAY],
        pytest.param(ExecutorName.RAY, signal.SIGTERM, marks=pytest.mark.campaign),
    ],
)
def test_no_worker_outlives_its_parent_by_two_seconds(tmp_path, how, name):
    if name is ExecutorName.RAY:
        pytest.importorskip("ray")
    script = tmp_path / "script.py"
    script.write_text(ORPHANS)
    environment = {k: v for k, v in os.environ.items() if k != "RAY_ADDRESS"}
    with subprocess.Popen(
        [sys.executable, str(script), str(tmp_path), name],
        env=environment | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as parent:
        deadline = time.monotonic() + 120
        workers = []
        while len(workers) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
            # A file is there before its number is.
            texts = [path.read_text() for path in tmp_path.glob("*.pid")]
            workers = [int(text) for text in texts if text]
        assert len(workers) == 2 and all(map(is_alive, workers))
        if name is ExecutorName.RAY:
            # Ray's agents beside them too.
            workers = children(parent_of(workers[0]))
            assert len(workers) >= 4
        parent.send_signal(how)
        parent.wait(30)
    ended = time.monotonic()
    while any(map(is_alive, workers)) and time.monotonic() < ended + 10:
        time.sleep(0.02)
    assert time.monotonic() - ended < 2.0


@pytest.fixture(scope="module")
def cluster():
    """Two workers of a Ray cluster on this machine."""
    ray = pytest.importorskip("ray")
    previous = os.environ.pop("RAY_ADDRESS", None)
    yield executor_named(ExecutorName.RAY, 2)
    ray.shutdown()
    if previous is not None:
        os.environ["RAY_ADDRESS"] = previous


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore")
def test_a_ray_cluster_does_what_one_process_does(cluster, tmp_path):
    works = [partial(squared, number) for number in range(6)]
    works += [partial(raises, ValueError("bad")), partial(dies_once, tmp_path / "marker")]
    results = {}
    assert run_all(works, cluster, results.__setitem__)
    assert [results[index] for index in range(6)] == [0, 1, 4, 9, 16, 25]
    assert isinstance(results[6], ValueError) and results[7] == "alive"


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore")
def test_a_ray_worker_that_is_killed_costs_its_own_piece_alone(cluster, tmp_path):
    killed = []

    def kill_first(index, result):
        # Of the first piece, once, while the others go on.
        if not killed:
            killed.append(int((tmp_path / "0.pid").read_text()))
            os.kill(killed[0], signal.SIGKILL)
        results[index] = result

    results = {}
    works = [partial(sleeps, tmp_path, 0, 6.0), *[partial(squared, k) for k in range(1, 4)]]
    works[1] = partial(sleeps, tmp_path, 1, 3.0)
    assert run_all(works, cluster, kill_first)
    assert killed and results == {0: 0, 1: 1, 2: 4, 3: 9}
