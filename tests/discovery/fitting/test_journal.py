"""An interrupted diagnosis goes on, and ends as if nothing had happened."""

import json
import shutil

import numpy as np
import pytest

from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.journal import Journal, JournalWarning, digest
from pma_gym.discovery.workflow import diagnose
from tests.discovery.laboratory import OFF, STATION, diagnosed, laboratory


@pytest.fixture(scope="module")
def trials():
    return laboratory("hysteresis")[0]


def interrupted(trials, folder, step, done, jobs=1):
    """Diagnose until so much of a step is done; the journal's files, and what they hold."""

    def progress(name, number, total):
        if name.startswith(step) and number >= done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagnose(trials, STATION, jobs=jobs, journal=folder, progress=progress)
    left = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert left
    return left


@pytest.fixture(scope="module")
def written(trials, tmp_path_factory):
    """The journal of a diagnosis by two jobs, which was interrupted and went on, and its text."""
    folder = tmp_path_factory.mktemp("journal")
    left = interrupted(trials, folder, "trials left out", 1, jobs=2)
    text = diagnose(trials, STATION, jobs=2, journal=folder, propose=False).text()
    # What was finished was not done again.
    assert left.items() <= {path.name: path.read_bytes() for path in folder.iterdir()}.items()
    return folder, text


def test_neither_jobs_nor_a_journal_nor_an_interrupt_change_a_byte(written):
    assert written[1] == diagnosed("hysteresis").text()


@pytest.mark.campaign
def test_a_diagnosis_that_is_interrupted_in_the_midst_of_its_fits_goes_on(
    trials, written, tmp_path
):
    left = interrupted(trials, tmp_path, "fitting effect 1", 3)
    assert diagnose(trials, STATION, journal=tmp_path, propose=False).text() == written[1]
    assert left.items() <= {path.name: path.read_bytes() for path in tmp_path.iterdir()}.items()


def test_a_whole_journal_gives_the_same_again(trials, written):
    folder, text = written
    times = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert diagnose(trials, STATION, journal=folder, propose=False).text() == text
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == times


@pytest.mark.parametrize("broken", [b"", b"{", b"[]", b"\xff\xfe", b"null"])
def test_broken_files_are_passed_over(trials, tmp_path, broken):
    folder = tmp_path / "broken"
    journal = Journal(folder, trials, STATION, "")
    journal.keep("fit", {"chi_square": 1.0})
    for path in folder.iterdir():
        path.write_bytes(broken)
    journal.keep("other", {"chi_square": 2.0})
    with pytest.warns(JournalWarning, match="broken holds a damaged fit .* computed anew") as said:
        assert journal.entry("fit") is None
        assert journal.entry("fit") is None
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


def test_broken_entries_and_those_of_other_forms_are_computed_anew(trials, written, tmp_path):
    folder = tmp_path / "other"
    shutil.copytree(written[0], folder)
    paths = sorted(folder.iterdir())
    for number, path in enumerate(paths):
        harm = list(OTHER_FORMS.values())[number % len(OTHER_FORMS)]
        path.write_text(harm(json.loads(path.read_text())))
    assert len(paths) >= len(OTHER_FORMS)
    with pytest.warns(JournalWarning) as said:
        assert diagnose(trials, STATION, journal=folder, propose=False).text() == written[1]
    assert len(said) == 1


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
    trial = trials[0]
    renamed = Trial(trial.time, trial.commands, {"load": trial.measurements["pressure"]})
    plain = Trial(trial.time, trial.commands, {"pressure": trial.measurements["pressure"]})
    assert digest([renamed], STATION, "") != digest([plain], STATION, "")


def test_no_folder_keeps_nothing(trials):
    journal = Journal(None, trials, STATION, "")
    journal.keep("fit", {"chi_square": 1.0})
    assert journal.entry("fit") is None


def test_a_folder_is_made_when_something_is_kept(trials, tmp_path):
    folder = tmp_path / "deep" / "er"
    journal = Journal(folder, trials, STATION, "")
    assert not folder.exists()
    journal.keep("fit", {"chi_square": 1.0})
    assert [path.suffix for path in folder.iterdir()] == [".json"]
    assert journal.entry("fit") == {"chi_square": 1.0}
    assert journal.entry("other") is None
