"""The short form of `make kills`: a command that is killed loses nothing."""

import os
import random

import pytest

from tests.kills.commands import Diagnose
from tests.kills.kill_and_resume import Killer


@pytest.mark.kills
@pytest.mark.skipif(os.name != "posix", reason="groups of processes are POSIX")
def test_a_killed_diagnosis_goes_on_and_loses_nothing(tmp_path):
    killer = Killer(Diagnose, tmp_path, random.Random(1), warm=True)
    losses = killer.run(1)
    assert losses.kills == 1 and losses.rounds >= 1
    assert losses.count == 0, losses
