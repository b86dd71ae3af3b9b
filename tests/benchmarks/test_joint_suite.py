"""The suite `joint`: frozen numbers, an oracle that bounds, runs that go on where they stopped."""

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


class Singular(Feedforward):
    """A controller whose design fails on every rig."""

    name = "singular"

    def reset(self, info):
        raise np.linalg.LinAlgError("no solution")


@pytest.fixture
def slice_of(monkeypatch, tmp_path):
    """Runs controllers on the first station of one rig, in trials of 3 s."""
    document = joint_suite().document
    short = document["environment"] | {"duration_s": 3.0}
    rigs = {"muscle_joint": document["rigs"]["muscle_joint"]}
    small = RigSuite({**document, "environment": short, "rigs": rigs})
    monkeypatch.setattr(joint, "joint_suite", lambda: small)
    return lambda *names, tasks=("steps",): joint.run_joint(
        names, 1, tasks, tmp_path, ThisProcess()
    )


def test_no_number_moves_without_a_new_version():
    suite = joint_suite()
    assert (suite.document["version"], suite.digest) == (VERSION, DIGEST)
    with pytest.raises(SuiteError, match="run --suite joint"):
        frozen_suite("joint")


def test_an_oracle_bounds_and_a_second_run_goes_on(slice_of, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(RIG_CONTROLLERS, "singular", Singular)
    everybody = "feedforward", "policy", "oracle", "singular"
    rows = slice_of(*everybody)
    percent = {row.controller: row.percent for row in rows}
    assert percent["oracle"] < 0.5 * percent["feedforward"] and percent["policy"] < 50.0
    assert percent["singular"] == joint.MISSED and rows[-1].ended_by == "no solution"
    assert len((tmp_path / "scores.csv").read_text().splitlines()) == len(rows) + 1
    assert "| bound | oracle |" in (tmp_path / "report.md").read_text()
    journal = tmp_path / "journal.jsonl"
    first, *others = journal.read_text().splitlines(keepends=True)
    journal.write_text("".join([first[:40] + "\n", *others]))
    calls, whole = [], joint.score_case
    monkeypatch.setattr(joint, "score_case", lambda *of: calls.append(of[1]) or whole(*of))
    again = slice_of(*everybody)
    assert calls == [["feedforward"]] and "damaged" in capsys.readouterr().err
    assert [row[:7] for row in again] == [row[:7] for row in rows]


def test_ctrl_c_keeps_what_is_done(slice_of, tmp_path, monkeypatch):
    whole = joint.score_case

    def score(case, names, known):
        if case.task == "sine_2hz":
            raise KeyboardInterrupt
        return whole(case, names, known)

    monkeypatch.setattr(joint, "score_case", score)
    with pytest.raises(KeyboardInterrupt):
        slice_of("pid", tasks=["sine_1hz", "sine_2hz"])
    assert len((tmp_path / "journal.jsonl").read_text().splitlines()) == 1


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (((["pda"], None, [])), "the controllers feedforward, pid.*got 'pda'"),
        ((([], 9, [])), "8 stations of a rig, got --stations 9"),
        ((([], None, ["sine"])), "tasks sine_0.1hz, .*got --task sine"),
        (((["brakeless"], 1, ["steps"])), "brakeless apply to no rig"),
    ],
)
def test_a_selection_that_cannot_be_is_refused(asked, message, tmp_path, monkeypatch):
    brakeless = type("Brakeless", (Feedforward,), {"missing": classmethod(lambda *info: "a brake")})
    monkeypatch.setitem(RIG_CONTROLLERS, "brakeless", brakeless)
    with pytest.raises(ValueError, match=message):
        joint.run_joint(*asked, tmp_path, ThisProcess())


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
    for rig in joint_suite().rigs:
        assert read_toml(tmp_path / "settings.toml")[rig]["pid"] == RIG_CONTROLLERS["pid"].settings
        assert ZipFile(joint.policy_file(rig)).namelist() == ["policy.pth"]
