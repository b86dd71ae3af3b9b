"""Gaps, copies, clocks and starts in motion: said before anything is fitted, and set right."""

import numpy as np
import pytest

from pma_gym.data.datasets.dataset import NamedTrial, read_dataset
from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import TrialError
from pma_gym.discovery import diagnose
from pma_gym.discovery.preparation.data_checks.averaging import averaged
from pma_gym.plant.model import load_model
from tests.discovery.preparation.data_checks.logs import GIVEN, checked, log, logs, write


def without(columns, start, stop):
    """A log without the rows of some times."""
    kept = (columns["time_s"] < start) | (columns["time_s"] >= stop)
    return {name: values[kept] for name, values in columns.items()}


def size_of(dataset, name):
    """An effect's size in a diagnosis that names it alone."""
    diagnosis = diagnose(dataset, GIVEN, propose=False)
    assert [each.name for each in diagnosis.effects] == [name], diagnosis.sentence
    return diagnosis.effects[0].parameters


@pytest.mark.campaign
def test_missing_rows_cut_a_trial_and_the_effect_is_still_named(tmp_path):
    folder = write(tmp_path / "lab", [without(each, 2.0, 3.4) for each in logs(seconds=8.0)])
    data = checked(folder)
    assert data.checked[0].startswith("all files: about 140 rows are missing from 1.99 to 3.4 s")
    assert "the trial is cut there; 2 pieces" in data.checked[0]
    names = [each.name for each in data.trials]
    assert names[:2] == ["trial0.csv", "trial0.csv from 3.4 s"]
    assert size_of(data, "hysteresis")["force_n"].value == pytest.approx(20.0, abs=0.5)


def test_a_command_that_is_missing_while_it_moves_cuts_a_trial(tmp_path):
    written = logs(seconds=8.0)
    for each in written:
        volts = each["motor_voltage_v"].copy()
        volts[200:260] = np.nan
        each["motor_voltage_v"] = volts
    data = checked(write(tmp_path / "lab", written))
    assert data.checked[0].startswith(
        "all files: motor_voltage_v has no value in 60 rows from 1.99 to 2.6 s (0.61 s)"
    )
    assert len(data) == 6


def test_a_command_that_is_written_once_is_held_and_no_gap(tmp_path):
    written = logs(seconds=3.0)
    for each in written:
        kpa = each["pressure_command_kpa"].copy()
        kpa[50:] = np.nan
        each["pressure_command_kpa"] = kpa
    assert checked(write(tmp_path / "lab", written)).checked == ()


def in_motion(folder, count=3):
    """A data set whose trials begin in motion, checked."""
    written = []
    for columns, begin in zip(logs(seconds=8.0)[:count], (1.3, 1.5, 1.2), strict=False):
        kept = {name: values[columns["time_s"] >= begin] for name, values in columns.items()}
        written.append(kept | {"time_s": kept["time_s"] - kept["time_s"][0]})
    return checked(write(folder, written))


def test_trials_that_begin_in_motion_get_a_start_of_their_own(tmp_path):
    data = in_motion(tmp_path / "lab", count=1)
    assert len(data.checked) == 1
    for words, each in zip(data.checked, data.trials, strict=True):
        assert f"{each.name} begins at 0.0" in words
        assert "m/s (contraction_mm), not at rest: commands that lead there from rest" in words
        # It begins settled: no command moves in its first rows, nothing counts there.
        assert np.ptp(each.trial.commands["motor_voltage"][:20]) == 0.0
        assert np.isnan(each.trial.measurements["contraction"][:100]).all()


@pytest.mark.campaign
def test_what_is_hidden_in_trials_that_begin_in_motion_is_sized(tmp_path):
    sizes = size_of(in_motion(tmp_path / "lab"), "hysteresis")
    assert sizes["force_n"].value == pytest.approx(20.0, abs=0.5)
    assert sizes["distance_mm"].value == pytest.approx(3.0, abs=0.15)


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


def test_a_repeat_with_noise_of_its_own_is_no_copy(tmp_path):
    written = [log(2.0, 300.0, seed, seconds=2.0) for seed in (1, 2)]
    assert checked(write(tmp_path / "lab", written)).checked == ()


def test_sample_numbers_are_no_seconds(tmp_path):
    written = [{**e, "time_s": np.arange(e["time_s"].size)} for e in logs(seconds=4.0)]
    folder = write(tmp_path / "lab", written)
    with pytest.raises(TrialError, match="one row a second, which cannot show this rig") as caught:
        checked(folder)
    line = '"time_s" = { name = "time_s", factor = 0.01 }'
    assert line in str(caught.value)
    (folder / "dataset.toml").write_text(f"[columns]\n{line}\n")
    assert checked(folder).checked == ()


@pytest.mark.parametrize(("factor", "words"), [(1e3, "is it in milliseconds"), (1 / 60, "in min")])
def test_other_clocks(tmp_path, factor, words):
    rate = 100.0 if factor > 1.0 else 1000.0
    written = [{**e, "time_s": factor * e["time_s"]} for e in logs(seconds=3.0, rate=rate)]
    folder = write(tmp_path / "lab", written)
    if factor > 1.0:
        with pytest.warns(UserWarning, match="time_s spans"), pytest.raises(TrialError) as caught:
            checked(folder)
    else:
        with pytest.raises(TrialError) as caught:
            checked(folder)
    assert words in str(caught.value)
    wanted = {1e3: "factor = 0.001", 1 / 60: "factor = 60"}[factor]
    assert wanted in str(caught.value)


def test_rounded_stamps_agree_as_even_ones_do(tmp_path):
    """A model that agrees is not made unknown by a logger that writes three decimals."""
    written = logs(truth=GIVEN, rate=384.0, seconds=4.0)
    for each in written:
        each["time_s"] = np.rint(1e3 * each["time_s"]) / 1e3
    data = checked(write(tmp_path / "lab", written))
    (words,) = data.checked
    assert words.startswith("all files: time_s is rounded to 1 ms by the logger")
    assert np.ptp(np.diff(data.trials[0].trial.time)) < 1e-9
    assert diagnose(data, GIVEN, propose=False).verdict in ("agrees", "undecidable")


def test_long_logs_are_averaged(tmp_path, monkeypatch):
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.MOST_ROWS", 2000)
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.AIM_ROWS", 1000)
    columns = log(2.0, 300.0, 1, rate=500.0, seconds=8.0)
    columns["motor_voltage_v"][2000:] = 1.0
    folder = write(tmp_path / "lab", [columns])
    data = checked(folder)
    assert "readings are averaged over 4 rows each, which leaves" in data.checked[-1]
    (given,), (fewer,) = read_dataset(folder).trials, data.trials
    assert len(fewer.trial) < 1100
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
@pytest.mark.parametrize("rate", [240.0, 250.0, 500.0, 1000.0, 2000.0, 10_000.0])
def test_hum_of_a_long_log_folds_to_no_slow_wave(rate, mains, monkeypatch):
    """1 kHz averaged over 16 rows has 0.8 of 60 Hz left, at 2.5 Hz, where a rig moves."""
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.MOST_ROWS", 1000)
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.AIM_ROWS", 20)
    time = np.arange(int(8 * rate)) / rate
    load = np.sin(2.0 * np.pi * mains * time) + 0.2 * np.cos(2.0 * np.pi * 0.5 * time)
    trial = Trial(time, {"motor_voltage": 0.0 * time}, {"load": load})
    (fewer,), (said,) = averaged([NamedTrial("long", trial)])
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


def test_a_block_in_which_readings_jump_has_no_average(tmp_path, monkeypatch):
    """Friction that turns round is a step; a parabola through it is neither side of it."""
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.MOST_ROWS", 2000)
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.AIM_ROWS", 1000)
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


def test_trials_of_one_rate_are_averaged_all_or_none(tmp_path, monkeypatch):
    """They share one noise, and averages have less: one that cannot be averaged keeps all whole."""
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.MOST_ROWS", 2000)
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.AIM_ROWS", 1000)
    plain, restless = (log(2.0, 300.0, seed, rate=500.0, seconds=4.0) for seed in (1, 2))
    noise = np.random.default_rng(3).standard_normal(len(restless["time_s"]))
    restless["motor_voltage_v"] = restless["motor_voltage_v"] + 0.1 * np.abs(noise)
    data = checked(write(tmp_path / "lab", [plain, restless]))
    assert [len(each.trial) for each in data.trials] == [2000, 2000]
    assert not any("averaged" in words for words in data.checked)


def test_a_slide_begins_where_it_likes(tmp_path):
    """Its pieces have starts of their own; it is only cut."""
    model = load_model(read_dataset("tests/discovery/rigs/driven_slide").model)
    folder = read_dataset("tests/discovery/rigs/driven_slide")
    from pma_gym.discovery.preparation.data_checks import check_dataset

    assert check_dataset(folder, model).checked == ()


def test_stamps_that_repeat_by_rounding_are_read(tmp_path):
    """Two decimals at 384 Hz."""
    written = logs(rate=384.0, seconds=2.0)
    for each in written:
        each["time_s"] = np.rint(1e2 * each["time_s"]) / 1e2
    folder = write(tmp_path / "lab", written)
    with pytest.warns(UserWarning, match="time_s is rounded to 10 ms by the logger"):
        (first, *_) = read_dataset(folder).trials
    assert np.diff(first.trial.time) == pytest.approx(1 / 384, rel=1e-3)


def test_rows_of_averages_and_of_commands_are_never_next_to_no_time_apart(tmp_path, monkeypatch):
    """The middle of an odd block is one of its rows."""
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.MOST_ROWS", 2000)
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.AIM_ROWS", 1000)
    columns = log(2.0, 300.0, 1, rate=500.0, seconds=6.0)
    (fewer,) = checked(write(tmp_path / "lab", [columns])).trials
    assert np.diff(fewer.trial.time).min() > 0.4 / 500.0


def test_a_log_whose_command_changes_in_every_row_keeps_its_readings(tmp_path, monkeypatch):
    """Its rows are needed all the same, and what is fast in it would only be hidden."""
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.MOST_ROWS", 2000)
    monkeypatch.setattr("pma_gym.discovery.preparation.data_checks.averaging.AIM_ROWS", 1000)
    columns = log(2.0, 300.0, 1, rate=500.0, seconds=6.0)
    noise = np.random.default_rng(1).normal(0.0, 0.02, len(columns["time_s"]))
    columns["motor_voltage_v"] = np.clip(columns["motor_voltage_v"] + 1.0 + noise, 0.0, 10.0)
    folder = write(tmp_path / "lab", [columns])
    data = checked(folder)
    assert not any("averaged" in words for words in data.checked)
    assert len(data.trials[0].trial) == len(read_dataset(folder).trials[0].trial)
