"""The suite is what the dissertation ran; a case's seed depends on its name alone."""

from dataclasses import replace

import pytest

from benchmarks.runner.case import cases
from benchmarks.runner.controller_spec import ControllerError, ControllerSpec, parse_controllers
from benchmarks.suites.frozen import load_suite
from benchmarks.suites.suite import Episode, SuiteError
from pma_gym.data.serres2008 import pressures
from pma_gym.plant.model import dump_model, load_model

MINE = """
class Mine:
    name = "mine"

    def reset(self, reference, station):
        pass

    def act(self, observation, time):
        return 1.0


class NoAct:
    def reset(self, reference, station):
        pass


class WrongAct(Mine):
    def act(self):
        return 1.0


class Picky(Mine):
    def __init__(self, gain):
        self.gain = gain


constant = 3
"""


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    return path


def test_the_suite_repeats_every_trial_of_the_dissertation():
    suite = load_suite()
    assert suite.pressures_kpa["displacement"] == pressures("displacement")
    assert suite.pressures_kpa["rotation"] == pressures("rotation")
    assert suite.models[0] == "station"
    assert {suite.goals.replay, *suite.goals.feedback} <= {c.name for c in suite.controllers}
    # The policy runs on the station alone.
    assert len(cases(suite, suite.entries)) == (2 * 4 + 1) * 17
    assert not suite.selected


def test_pictured_pressures_are_run():
    suite = load_suite()
    for task, pictured in suite.pictured_kpa.items():
        assert set(pictured) <= set(suite.pressures_kpa[task])


def test_seeds_are_frozen_and_differ():
    suite = load_suite()
    every = cases(suite, suite.entries)
    seeds = {case.name: suite.seed_of(case.episode, case.spec.name) for case in every}
    assert len(set(seeds.values())) == len(seeds)
    # Frozen: another value here would be another benchmark.
    assert seeds["station/pid/rotation/300"] == 536785835


def test_seeds_do_not_depend_on_folders_or_on_other_cases(tmp_path):
    suite = load_suite()
    (tmp_path / "far").mkdir()
    folders = [tmp_path, tmp_path / "far"]
    for folder in folders:
        (folder / "model.toml").write_text(dump_model(load_model("serres2008")))
    here, there = (suite.select([str(folder / "model.toml")]) for folder in folders)
    trial = Episode(0, "rotation", 300.0, 0)
    assert here.seed_of(trial, "Mine") == there.seed_of(trial, "Mine")
    fewer = suite.select(tasks=["rotation"])
    for case in cases(fewer, fewer.entries):
        name = case.spec.name
        assert fewer.seed_of(case.episode, name) == suite.seed_of(case.episode, name)
    assert replace(suite, seed=1).seed_of(trial, "pid") != suite.seed_of(trial, "pid")


def test_rows_of_another_model_are_not_used_again_and_fewer_trials_are(tmp_path):
    suite, path = load_suite(), tmp_path / "model.toml"
    path.write_text(dump_model(load_model("serres2008")))
    one = suite.select([str(path)])
    path.write_text(dump_model(load_model("station")))
    other = suite.select([str(path)])
    assert len({suite.digest, one.digest, other.digest}) == 3
    assert suite.select(tasks=["rotation"], pressures_kpa=[300]).digest == suite.digest


def test_a_selection_says_so():
    suite = load_suite()
    assert suite.select(pressures_kpa=[300]).pressures_kpa == {
        "displacement": (300,),
        "rotation": (300,),
    }
    assert suite.select(pressures_kpa=[150]).pressures_kpa == {"displacement": (150,)}
    assert suite.select(models=["serres2008"]).selected
    assert not suite.select(controllers=suite.controllers).selected


def test_a_selection_that_does_not_exist_is_refused():
    suite = load_suite()
    with pytest.raises(SuiteError, match="no trial at 310 kPa.*150, 200"):
        suite.select(pressures_kpa=[300, 310])
    with pytest.raises(SuiteError, match="task must be displacement or rotation, got 'lift'"):
        suite.select(tasks=["lift"])
    with pytest.raises(SuiteError, match="two controllers are called Mine"):
        suite.select(
            controllers=[ControllerSpec("Mine", path="a.py"), ControllerSpec("Mine", path="b.py")]
        )


def test_a_file_of_ones_own_is_scored_beside_the_shipped(mine):
    suite = load_suite()
    replay, own = parse_controllers(f"serres_replay, {mine}:Mine", suite.controllers)
    assert replay == suite.controllers[0]
    # Its column is headed by what it calls itself.
    assert (own.name, own.label, own.source) == ("Mine", "mine", f"{mine}:Mine")
    assert own.make().act(None, 0.0) == 1.0


def test_columns_that_would_have_one_name_are_told_apart(mine):
    mine.write_text(
        MINE + "\n\nclass Heir(Mine):\n    pass\n\n\nclass Bold(Mine):\n    name = 'Measured'\n"
        "\n\nclass Nameless(Mine):\n    name = None\n"
    )
    text = ",".join(f"{mine}:{name}" for name in ("Mine", "Heir", "Bold", "Nameless"))
    suite = load_suite().select(controllers=parse_controllers(text))
    labels = [controller.label for controller in suite.controllers]
    assert labels == ["mine (Mine)", "mine (Heir)", "Measured (Bold)", "Nameless"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("serres_reply", "no controller 'serres_reply'.*did you mean serres_replay"),
        ("serres_replay,,pid", "empty name"),
        ("{mine}", "names no class; write .*mine.py:ClassName"),
        ("{mine}:Nobody", "has no class 'Nobody'; it has Mine, NoAct, WrongAct, Picky"),
        ("{mine}:constant", "has no class 'constant'"),
        ("{mine}:NoAct", r"has no method act\(observation, time\)"),
        ("{mine}:WrongAct", r"act must take \(observation, time\)"),
        ("{mine}:Picky", r"cannot make .*Picky\(\) raised TypeError.*must need no arguments"),
        ("nowhere.py:Mine", "there is no file nowhere.py"),
    ],
)
def test_a_controller_that_does_not_fit_is_refused(mine, text, message):
    with pytest.raises(ControllerError, match=message):
        parse_controllers(text.format(mine=mine))


def test_a_file_that_cannot_be_imported_is_refused(tmp_path):
    broken = tmp_path / "broken.py"
    broken.write_text("import nothing_of_that_name\n")
    with pytest.raises(ControllerError, match="cannot import .*ModuleNotFoundError"):
        parse_controllers(f"{broken}:Mine")
