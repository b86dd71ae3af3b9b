"""The suite `joint`: frozen numbers, an oracle that bounds, runs that go on where they stopped."""

from unittest.mock import Mock
from zipfile import ZipFile

import numpy as np
import pytest

from benchmarks.executors.executor import ThisProcess
from benchmarks.rigs import joint
from benchmarks.rigs.suite import RigSuite, joint_suite
from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import SuiteError
from controllers.rigs import RIG_CONTROLLERS, Feedforward
from pma_gym.documents import read_toml

VERSION, DIGEST = 1, "5fd382687c050567"
"""Of the suite's numbers and drawn stations. Who changes one gives it a new version."""


@pytest.fixture
def slice_of(monkeypatch, tmp_path):
    """Runs controllers on the first station of one rig, in trials of 3 s."""
    document = joint_suite().document
    small = {"environment": document["environment"] | {"duration_s": 3.0}}
    small |= {"rigs": {"muscle_joint": document["rigs"]["muscle_joint"]}}
    monkeypatch.setattr(joint, "joint_suite", lambda: RigSuite(document | small))
    return lambda *names, tasks=("steps",): joint.run_joint(
        names, 1, tasks, tmp_path, ThisProcess()
    )


def test_no_number_moves_without_a_new_version():
    assert (joint_suite().document["version"], joint_suite().digest) == (VERSION, DIGEST)
    with pytest.raises(SuiteError, match="run --suite joint"):
        frozen_suite("joint")


def test_an_oracle_bounds_and_a_stopped_run_goes_on(slice_of, tmp_path, monkeypatch, capsys):
    reset = Mock(side_effect=np.linalg.LinAlgError("no solution"))
    monkeypatch.setitem(RIG_CONTROLLERS, "singular", type("Own", (Feedforward,), {"reset": reset}))
    everybody, journal = ("feedforward", "policy", "oracle", "singular"), tmp_path / "journal.jsonl"
    rows = slice_of(*everybody)
    percent = {row.controller: row.percent for row in rows}
    assert percent["oracle"] < 0.5 * percent["feedforward"] and percent["policy"] < 50.0
    assert percent["singular"] == joint.MISSED and rows[-1].ended_by == "no solution"
    assert len((tmp_path / "scores.csv").read_text().splitlines()) == len(rows) + 1
    assert "| bound | oracle |" in (tmp_path / "report.md").read_text()
    score, pid = joint.score_case, rows[0]._replace(controller="pid", task="sine_2hz")
    monkeypatch.setattr(joint, "score_case", Mock(side_effect=[[pid], KeyboardInterrupt]))
    with pytest.raises(KeyboardInterrupt):
        slice_of("pid", tasks=["sine_2hz", "steps"])
    first, *others = journal.read_text().splitlines(keepends=True)
    assert len(others) == len(rows) and '"pid"' in others[-1]
    journal.write_text("".join([first[:40] + "\n", *others]))
    monkeypatch.setattr(joint, "score_case", again := Mock(side_effect=score))
    assert [row[:7] for row in slice_of(*everybody)] == [row[:7] for row in rows]
    assert again.call_args.args[1] == ["feedforward"] and "damaged" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "stations", "tasks", "message"),
    [
        (["pda"], None, [], "the controllers feedforward, pid.*got 'pda'"),
        ([], 9, [], "8 stations of a rig, got --stations 9"),
        ([], None, ["sine"], "tasks sine_0.1hz, .*got --task sine"),
        (["brakeless"], 1, ["steps"], "brakeless apply to no rig"),
    ],
)
def test_a_selection_that_cannot_be_is_refused(
    names, stations, tasks, message, tmp_path, monkeypatch
):
    brakeless = type("Own", (Feedforward,), {"missing": lambda info: "a brake"})
    monkeypatch.setitem(RIG_CONTROLLERS, "brakeless", brakeless)
    with pytest.raises(ValueError, match=message):
        joint.run_joint(names, stations, tasks, tmp_path, ThisProcess())


def test_what_is_tuned_and_trained_is_shipped_without_the_optimiser(tmp_path, monkeypatch):
    def train(options, signal, file, *rest, reference):
        assert set(options) > {"push", "load", "randomisation"}
        with ZipFile(file, "w") as whole:
            whole.writestr("policy.pth", b"weights")
            whole.writestr("policy.optimizer.pth", b"moments")

    monkeypatch.setattr(joint, "train", train)
    monkeypatch.setattr(
        joint, "settings_of", lambda out, key, name, *rest: RIG_CONTROLLERS[name].settings
    )
    monkeypatch.setattr(joint, "FOLDER", tmp_path)
    monkeypatch.setattr(joint, "SETTINGS", tmp_path / "settings.toml")
    (tmp_path / "tuning").mkdir()
    joint.tune_joint(tmp_path)
    shipped = read_toml(joint.SETTINGS)
    assert {shipped[rig]["pid"]["integral"] for rig in joint_suite().rigs} == {2.0}
    names = [ZipFile(joint.policy_file(rig)).namelist() for rig in joint_suite().rigs]
    assert names == 3 * [["policy.pth"]]
