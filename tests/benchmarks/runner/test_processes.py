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

from benchmarks.reproduction.execution import execute
from benchmarks.runner.controller_spec import Contender
from benchmarks.runner.processes import run_all
from benchmarks.runner.worker import ProcessDied
from benchmarks.suites.reproduction import load_suite
from tests.benchmarks.pieces import awkward, dies_once, exits, kills_itself, raises

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
from benchmarks.runner.processes import run_all

def sleeper(folder, index):
    if index:
        (folder / str(index)).touch()
        time.sleep(600)
    return index

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    works = [partial(sleeper, folder, index) for index in range(4)]
    print(run_all(works, 2, lambda index, result: print("done", index, flush=True)), flush=True)
"""


def run(works, jobs=2):
    results = {}
    assert run_all(works, jobs, results.__setitem__)
    return results


def test_only_the_piece_whose_process_dies_is_lost():
    found = run([partial(abs, -1), partial(exits, 3), kills_itself, *map(partial, [int] * 5)])
    assert found[0] == 1 and [found[index] for index in range(3, 8)] == [0] * 5
    assert isinstance(found[1], ProcessDied) and found[1].exit_code == 3
    assert "its process died, and again when it ran alone: exit code 3; look for" in str(found[1])
    assert found[2].exit_code == -9
    assert "exit code -9, killed by SIGKILL; mostly for want of memory" in str(found[2])


def test_a_piece_that_dies_once_is_run_again(tmp_path):
    assert run([partial(dies_once, tmp_path / "marker"), int, int]) == {0: "alive", 1: 0, 2: 0}


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_raised_is_the_result(jobs):
    found = run([partial(raises, ValueError("bad")), partial(raises, SystemExit(7)), int], jobs)
    assert isinstance(found[0], ValueError) and str(found[0]) == "bad"
    assert isinstance(found[1], SystemExit) and found[2] == 0


def test_what_cannot_travel_costs_its_own_piece_alone():
    local = lambda: 1  # noqa: E731
    found = run([local, awkward, threading.Lock, int])
    assert isinstance(found[0], Exception) and isinstance(found[2], TypeError)
    assert str(found[1]) == "Awkward: one two"
    assert found[3] == 0


def test_a_case_whose_process_dies_fails_alone(tmp_path):
    path = tmp_path / "deadly.py"
    path.write_text(DEADLY)
    contender = Contender("Deadly", path=str(path))
    pressures = (200, 250, 300, 350, 400)
    suite = load_suite().select(["serres2008"], [contender], ["displacement"], pressures)
    done = execute(suite, 2)
    assert done.complete
    failures = {o.score.case.pressure_kpa: o.score.failure for o in done.outcomes}
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
