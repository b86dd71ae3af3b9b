"""An interrupted diagnosis goes on, and ends as if nothing had happened."""

import json

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery import workflow
from pma_gym.discovery.fitting.journal import Journal, JournalWarning, digest
from pma_gym.discovery.selection.candidate_fits import refit
from pma_gym.discovery.workflow import diagnose
from tests.discovery.grey_box import test_free_rigs
from tests.discovery.laboratory import OFF, STATION, diagnosed, fit_problem, laboratory

SMALL = ("hysteresis", 2, 32.0)


@pytest.fixture(scope="module")
def trials():
    return laboratory(*SMALL)[0]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("step", "done", "jobs"),
    [
        ("trials left out", 1, 2),
        pytest.param("fitting effect 1", 3, 1, marks=pytest.mark.campaign),
    ],
)
def test_neither_jobs_nor_a_journal_nor_an_interrupt_change_a_byte(
    trials, tmp_path, step, done, jobs
):
    def progress(name, number, total):
        if name.startswith(step) and number >= done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagnose(trials, STATION, jobs=jobs, journal=tmp_path, progress=progress)
    left = contents(tmp_path)
    whole = [diagnose(trials, STATION, jobs=jobs, journal=tmp_path, propose=False).text()]
    # What was finished was not done again.
    assert left and left.items() <= contents(tmp_path).items()
    times = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    whole.append(diagnose(trials, STATION, journal=tmp_path, propose=False).text())
    assert whole == [diagnosed(*SMALL).text()] * 2
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()} == times


def test_fits_of_an_interrupted_joint_are_restored_bit_for_bit_and_damaged_ones_made_anew(tmp_path):
    asked = test_free_rigs.logs("joint", 1.0), test_free_rigs.model("joint")

    def progress(name, number, total):
        if number == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workflow.refit(*asked, journal=tmp_path, progress=progress)
    left, whole = contents(tmp_path), workflow.refit(*asked).text()
    assert workflow.refit(*asked, journal=tmp_path).text() == whole
    assert left and left.items() < contents(tmp_path).items()
    for (name, content), damage in zip(left.items(), DAMAGES, strict=False):
        (tmp_path / name).write_text(json.dumps(damage(json.loads(content))))
    with pytest.warns(JournalWarning):
        assert workflow.refit(*asked, journal=tmp_path).text() == whole
    assert left.items() < contents(tmp_path).items()


DAMAGES = [
    lambda entry: entry | {"values": entry["values"][1:]},
    lambda entry: entry | {"values": [None, *entry["values"][1:]]},
    lambda entry: entry | {"scores": entry["values"]},
    lambda entry: entry | {"information": [[float("nan")] * len(entry["values"])]},
    lambda entry: entry | {"value": float("nan")},
]


@pytest.mark.parametrize("broken", [b"", b"{", b"[]", b"\xff\xfe", b"null"])
def test_broken_files_are_passed_over(trials, tmp_path, broken):
    journal = Journal(folder := tmp_path / "broken", trials, STATION, "")
    journal.keep("fit", {"chi_square": 1.0})
    for path in folder.iterdir():
        path.write_bytes(broken)
    journal.keep("other", {"chi_square": 2.0})
    with pytest.warns(JournalWarning, match="broken holds a damaged fit .* computed anew") as said:
        assert [journal.entry("fit") for _ in range(2)] == [None, None]
    assert len(said) == 1
    assert journal.entry("other") == {"chi_square": 2.0}


def _first(entry, key, value):
    return json.dumps(entry | {key: [value, *entry[key][1:]]})


OTHER_FORMS = {
    "broken off": lambda entry: json.dumps(entry)[:-5],
    "empty object": lambda entry: "{}",
    "text for a number": lambda entry: _first(entry, "values", "1"),
    "another parameter": lambda entry: _first(entry, "paths", "drive.no_such"),
    "out of bounds": lambda entry: _first(entry, "values", -1e300),
    "too few": lambda entry: json.dumps(entry | {"values": entry["values"][1:]}),
    "flat covariance": lambda entry: json.dumps(entry | {"covariance": entry["values"]}),
    "no number": lambda entry: json.dumps(entry | {"chi_square": float("nan")}),
    "null": lambda entry: json.dumps(dict.fromkeys(entry)),
    "deep": lambda entry: "[" * 100_000,
}


@pytest.mark.parametrize("form", OTHER_FORMS)
def test_an_entry_of_another_form_is_computed_anew(trials, tmp_path, form):
    problem = fit_problem(trials[:1])
    begun = problem.fit(STATION)
    fit = refit(problem, begun, (), Journal(tmp_path, trials, STATION, ""))
    (path,) = tmp_path.iterdir()
    path.write_text(OTHER_FORMS[form](json.loads(kept := path.read_text())))
    with pytest.warns(JournalWarning):
        again = refit(problem, begun, (), Journal(tmp_path, trials, STATION, ""))
    assert again.chi_square == fit.chi_square and path.read_text() == kept


def test_another_question_finds_nothing(trials, tmp_path):
    Journal(tmp_path, trials, STATION, "seed 0").keep("fit", {"chi_square": 1.0})
    copies = [Trial(each.time, each.commands, each.measurements) for each in trials]
    assert Journal(tmp_path, copies, STATION, "seed 0").entry("fit") == {"chi_square": 1.0}
    other = trials[0].measurements["load"].copy()
    other[7] = np.nextafter(other[7], np.inf)
    touched = Trial(trials[0].time, trials[0].commands, {**trials[0].measurements, "load": other})
    for asked, model, question in (
        (trials, STATION, "seed 1"),
        (trials, STATION.replace(OFF), "seed 0"),
        (trials[:-1], STATION, "seed 0"),
        ([*trials[1:], trials[0]], STATION, "seed 0"),
        ([touched, *trials[1:]], STATION, "seed 0"),
    ):
        assert Journal(tmp_path, asked, model, question).entry("fit") is None


def test_a_missing_reading_is_not_a_missing_signal(trials):
    trial, read = trials[0], trials[0].measurements["pressure"]
    one, other = (
        digest([Trial(trial.time, trial.commands, {name: read})], STATION, "")
        for name in ("load", "pressure")
    )
    assert one != other


def test_a_folder_is_made_when_something_is_kept_and_none_keeps_nothing(trials, tmp_path):
    folder, kept = tmp_path / "deep" / "er", {"chi_square": 1.0}
    journals = [Journal(each, trials, STATION, "") for each in (folder, None)]
    assert not folder.exists()
    for journal in journals:
        journal.keep("fit", kept)
    assert [path.suffix for path in folder.iterdir()] == [".json"]
    assert [journal.entry("fit") for journal in journals] == [kept, None]
    assert journals[0].entry("other") is None
