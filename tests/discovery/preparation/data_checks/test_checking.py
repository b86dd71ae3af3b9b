"""Gaps, copies, clocks and starts in motion: said before anything is fitted, and set right."""

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import NamedTrial, read_dataset
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery import diagnose
from pma_gym.discovery.preparation.data_checks import averaging, check_dataset
from pma_gym.plant.model import load_model
from tests.discovery.preparation.data_checks.logs import GIVEN, checked, log, logs, write


@pytest.fixture
def few_rows(monkeypatch):
    """Logs of more than 2000 rows are long, and are averaged to about 1000."""
    monkeypatch.setattr(averaging, "MOST_ROWS", 2000)
    monkeypatch.setattr(averaging, "AIM_ROWS", 1000)


def without(columns, start, stop):
    """A log without the rows of some times."""
    kept = (columns["time_s"] < start) | (columns["time_s"] >= stop)
    return {name: values[kept] for name, values in columns.items()}


def in_motion(folder, count=3):
    """A data set whose trials begin in motion, checked."""
    written = []
    for columns, begin in zip(logs(seconds=8.0)[:count], (1.3, 1.5, 1.2), strict=False):
        kept = without(columns, 0.0, begin)
        written.append(kept | {"time_s": kept["time_s"] - kept["time_s"][0]})
    return checked(write(folder, written))


def cut(folder):
    """A data set without the rows of a second in each trial, checked."""
    return checked(write(folder, [without(each, 2.0, 3.4) for each in logs(seconds=8.0)]))


@pytest.mark.campaign
@pytest.mark.parametrize("made", [cut, in_motion])
def test_what_is_hidden_is_sized_in_cut_trials_and_in_those_that_begin_in_motion(made, tmp_path):
    diagnosis = diagnose(made(tmp_path / "lab"), GIVEN, propose=False)
    (effect,) = diagnosis.effects
    assert effect.name == "hysteresis", diagnosis.sentence
    assert effect.parameters["force_n"].value == pytest.approx(20.0, abs=0.5)
    assert effect.parameters["distance_mm"].value == pytest.approx(3.0, abs=0.15)


def test_missing_rows_cut_a_trial(tmp_path):
    data = cut(tmp_path / "lab")
    assert data.checked[0].startswith("all files: about 140 rows are missing from 1.99 to 3.4 s")
    assert "the trial is cut there; 2 pieces" in data.checked[0]
    names = [each.name for each in data.trials]
    assert names[:2] == ["trial0.csv", "trial0.csv from 3.4 s"]


@pytest.mark.parametrize(
    ("column", "gap", "pieces", "said"),
    [
        # A command that is missing while it moves cuts a trial; one that is written once is held.
        ("motor_voltage_v", slice(200, 260), 6, "has no value in 60 rows from 1.99 to 2.6 s (0.6"),
        ("pressure_command_kpa", slice(50, None), 3, ""),
    ],
)
def test_commands_that_are_missing(tmp_path, column, gap, pieces, said):
    written = logs(seconds=8.0)
    for each in written:
        each[column][gap] = np.nan
    data = checked(write(tmp_path / "lab", written))
    assert len(data) == pieces and bool(said) == bool(data.checked)
    assert not said or data.checked[0].startswith(f"all files: {column} {said}")


def test_trials_that_begin_in_motion_get_a_start_of_their_own(tmp_path):
    data = in_motion(tmp_path / "lab", count=1)
    (words,), (each,) = data.checked, data.trials
    assert f"{each.name} begins at 0.0" in words
    assert "m/s (contraction_mm), not at rest: commands that lead there from rest" in words
    # It begins settled: no command moves in its first rows, nothing counts there.
    assert np.ptp(each.trial.commands["motor_voltage"][:20]) == 0.0
    assert np.isnan(each.trial.measurements["contraction"][:100]).all()


def test_a_piece_too_short_to_forget_its_beginning_is_named_and_left_out(tmp_path):
    columns = without(log(2.0, 300.0, 1, seconds=4.2), 2.0, 3.5)
    data = checked(write(tmp_path / "lab", [columns]))
    assert [each.name for each in data.trials] == ["trial0.csv"]
    assert "depends on how it began: it is not used; begin the log at rest" in data.checked[-1]


def test_copies_are_used_once(tmp_path):
    originals = logs(seconds=3.0)
    later = {name: v + 100.0 * (name == "time_s") for name, v in originals[0].items()}
    folder = write(tmp_path / "lab", [*originals, originals[1], later])
    (folder / "dataset.toml").write_text('[trials."trial2.csv"]\nrepeat_of = "trial3.csv"\n')
    data = checked(folder)
    assert [each.name for each in data.trials] == ["trial0.csv", "trial1.csv", "trial2.csv"]
    assert data.trials[2].repeat_of == "trial1.csv"
    assert sorted(data.checked) == [
        f"{copy} has the same content as {first}: a copy is no second measurement, it is used once"
        for copy, first in (("trial3.csv", "trial1.csv"), ("trial4.csv", "trial0.csv"))
    ]


def test_what_is_as_it_should_be_passes(tmp_path):
    """A repeat with noise of its own is no copy; a slide begins where it likes, and is only cut."""
    written = [log(2.0, 300.0, seed, seconds=2.0) for seed in (1, 2)]
    assert checked(write(tmp_path / "lab", written)).checked == ()
    slide = read_dataset("tests/discovery/rigs/driven_slide")
    assert check_dataset(slide, load_model(slide.model)).checked == ()


def test_sample_numbers_are_no_seconds(tmp_path):
    written = [{**e, "time_s": np.arange(e["time_s"].size)} for e in logs(seconds=4.0)]
    folder = write(tmp_path / "lab", written)
    with pytest.raises(TrialError, match="one row a second, which cannot show this rig") as caught:
        checked(folder)
    line = '"time_s" = { name = "time_s", factor = 0.01 }'
    assert line in str(caught.value)
    (folder / "dataset.toml").write_text(f"[columns]\n{line}\n")
    assert checked(folder).checked == ()


@pytest.mark.filterwarnings("ignore:.*time_s spans:UserWarning")
@pytest.mark.parametrize(
    ("factor", "rate", "words", "line"),
    [
        (1e3, 100.0, "is it in milliseconds", "factor = 0.001"),
        (1 / 60, 1000.0, "in min", "factor = 60"),
    ],
)
def test_other_clocks(tmp_path, factor, rate, words, line):
    written = [{**e, "time_s": factor * e["time_s"]} for e in logs(seconds=3.0, rate=rate)]
    with pytest.raises(TrialError, match=words) as caught:
        checked(write(tmp_path / "lab", written))
    assert line in str(caught.value)


def stamped(folder, digits, seconds):
    """Logs at 384 Hz whose stamps have so many decimals."""
    written = logs(truth=GIVEN, rate=384.0, seconds=seconds)
    return write(folder, [{**e, "time_s": np.round(e["time_s"], digits)} for e in written])


def test_rounded_stamps_become_even(tmp_path):
    data = checked(stamped(tmp_path / "three", 3, 4.0))
    (words,) = data.checked
    assert words.startswith("all files: time_s is rounded to 1 ms by the logger")
    assert np.ptp(np.diff(data.trials[0].trial.time)) < 1e-9
    with pytest.warns(UserWarning, match="time_s is rounded to 10 ms by the logger"):
        (first, *_) = read_dataset(stamped(tmp_path / "two", 2, 2.0)).trials
    assert np.diff(first.trial.time) == pytest.approx(1 / 384, rel=1e-3)


@pytest.mark.campaign
def test_rounded_stamps_agree_as_even_ones_do(tmp_path):
    """A model that agrees is not made unknown by a logger that writes three decimals."""
    data = checked(stamped(tmp_path / "lab", 3, 4.0))
    assert diagnose(data, GIVEN, propose=False).verdict in ("agrees", "undecidable")


def test_long_logs_are_averaged(tmp_path, few_rows):
    columns = log(2.0, 300.0, 1, rate=500.0, seconds=8.0)
    columns["motor_voltage_v"][2000:] = 1.0
    folder = write(tmp_path / "lab", [columns])
    data = checked(folder)
    assert "readings are averaged over 4 rows each, which leaves" in data.checked[-1]
    (given,), (fewer,) = read_dataset(folder).trials, data.trials
    assert len(fewer.trial) < 1100
    # The middle of an odd block is one of its rows: no two are next to no time apart.
    assert np.diff(fewer.trial.time).min() > 0.4 / 500.0
    # The commands are the same courses, the jump included.
    linear = np.interp(given.trial.time, fewer.trial.time, fewer.trial.commands["motor_voltage"])
    assert np.max(np.abs(linear - given.trial.commands["motor_voltage"])) < 1.1e-4 * 5.0
    row = fewer.trial.measurements["load"]
    there = np.flatnonzero(np.isfinite(row))
    block = given.trial.measurements["load"][4 * 70 : 4 * 71]
    parabola = np.polyval(np.polyfit([-1.5, -0.5, 0.5, 1.5], block, 2), 0.0)
    assert row[there[70]] == pytest.approx(parabola, abs=1e-9)
    # No corner is cut: the mean of readings of a bent course misses its middle.
    assert abs(block.mean() - parabola) > 1e-4


@pytest.mark.parametrize("mains", [50.0, 60.0])
@pytest.mark.parametrize("rate", [240.0, 500.0, 1000.0, 10_000.0])
def test_hum_of_a_long_log_folds_to_no_slow_wave(rate, mains, monkeypatch):
    """1 kHz averaged over 16 rows has 0.8 of 60 Hz left, at 2.5 Hz, where a rig moves."""
    monkeypatch.setattr(averaging, "MOST_ROWS", 1000)
    monkeypatch.setattr(averaging, "AIM_ROWS", 20)
    time = np.arange(int(8 * rate)) / rate
    load = np.sin(2.0 * np.pi * mains * time) + 0.2 * np.cos(2.0 * np.pi * 0.5 * time)
    trial = Trial(time, {"motor_voltage": 0.0 * time}, {"load": load})
    (fewer,), (said,) = averaging.averaged([NamedTrial("long", trial)])
    assert "readings are averaged over" in said
    row = fewer.trial.measurements["load"]
    known = np.isfinite(row)
    assert known.sum() < 1 + len(time) / 2
    hertz = np.arange(1, 30) / 8.0
    waves = np.exp(-2j * np.pi * hertz[:, None] * fewer.trial.time[known])
    slow = 2.0 * np.abs(waves @ row[known]) / known.sum()
    # What the rig does is kept: the parabola's share of a slow wave is 1.
    assert slow[hertz == 0.5] == pytest.approx(0.2, abs=0.02)
    assert slow[hertz != 0.5].max() < 0.06


def test_a_block_in_which_readings_jump_has_no_average(tmp_path, few_rows):
    """Friction that turns round is a step; a parabola through it is neither side of it."""
    columns = log(2.0, 300.0, 1, rate=500.0, seconds=8.0)
    columns["load_n"] = columns["load_n"] + 80.0 * (np.arange(len(columns["load_n"])) >= 2002)
    (fewer,) = checked(write(tmp_path / "lab", [columns])).trials
    row = fewer.trial.measurements["load"]
    around = (fewer.trial.time > 2002 / 500.0 - 0.06) & (fewer.trial.time < 2002 / 500.0 + 0.06)
    known = row[around][np.isfinite(row[around])]
    jump = float(np.diff(known).max())
    assert jump == pytest.approx(80.0, abs=5.0)
    # Every other reading is near one side.
    assert np.sort(np.abs(np.diff(known)))[-2] < 10.0


def test_trials_of_one_rate_are_averaged_all_or_none(tmp_path, few_rows):
    """One whose command changes in every row keeps its readings, and all share one noise."""
    plain, restless = (log(2.0, 300.0, seed, rate=500.0, seconds=6.0) for seed in (1, 2))
    noise = np.random.default_rng(3).standard_normal(len(restless["time_s"]))
    restless["motor_voltage_v"] = restless["motor_voltage_v"] + 0.1 * np.abs(noise)
    data = checked(write(tmp_path / "lab", [plain, restless]))
    assert [len(each.trial) for each in data.trials] == [3000, 3000]
    assert not any("averaged" in words for words in data.checked)
