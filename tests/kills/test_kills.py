"""The short form of `make kills`: a command that is killed loses nothing."""

import os
import random
import signal
import subprocess
import time

import pytest

from tests.kills.commands import ROOT, Diagnose, DiagnoseJoint
from tests.kills.kill_and_resume import Killer


@pytest.mark.kills
@pytest.mark.skipif(os.name != "posix", reason="groups of processes are POSIX")
def test_a_killed_diagnosis_goes_on_and_loses_nothing(tmp_path):
    killer = Killer(Diagnose, tmp_path, random.Random(1), warm=True)
    losses = killer.run(1)
    assert losses.kills == 1 and losses.rounds >= 1
    assert losses.count == 0, losses


@pytest.mark.kills
@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is a signal")
def test_ctrl_c_ends_the_diagnosis_of_a_joint_and_it_goes_on_to_the_same_bits(tmp_path):
    whole, halved = (DiagnoseJoint(tmp_path / name) for name in ("whole", "halved"))
    options = {"cwd": ROOT, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    # A test run in the background ignores Ctrl-C, and its children would inherit that.
    options["preexec_fn"] = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)
    with subprocess.Popen(halved.arguments(), **options) as process:
        while process.poll() is None and len(halved.finished()) < 10:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 130
    assert said.endswith("interrupted; the same command with --resume goes on\n")
    assert len(halved.finished()) >= 10
    for command in (whole, halved):
        subprocess.run(command.arguments(), check=True, **options)
    assert halved.final() == whole.final()
