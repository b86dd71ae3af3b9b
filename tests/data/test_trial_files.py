import datetime
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from pma_gym.data.files import trial_files
from pma_gym.data.files.trial_files import TrialWarning, place_in_file, read_trial, write_trial
from pma_gym.data.readers import parquet
from pma_gym.data.readers.table import Request
from pma_gym.data.trial import COMMANDS, MEASUREMENTS, Trial, TrialError

SUFFIXES = [".csv", ".parquet", ".xlsx"]
GOOD = "time_s,motor_voltage_v,contraction_mm\n0,0,40\n0.5,1,\n1,2,25.3\n"

# What a station can show in SI, nanometres to megapascals, and NaN for a gap.
magnitude = st.floats(1e-9, 1e7)
measured = magnitude | magnitude.map(lambda value: -value) | st.sampled_from([0.0, np.nan])


@st.composite
def trials(draw):
    rows = draw(st.integers(1, 6))
    steps = draw(arrays(float, rows, elements=st.floats(1e-4, 100)))
    commands = draw(st.sets(st.sampled_from(COMMANDS), min_size=1))
    volts = st.floats(0, 10) | st.just(np.nan)
    return Trial(
        time=np.cumsum(steps),
        commands={
            name: draw(arrays(float, rows, elements=volts if "voltage" in name else measured))
            for name in commands
        },
        measurements={
            name: draw(arrays(float, rows, elements=measured))
            for name in draw(st.sets(st.sampled_from(MEASUREMENTS)))
        },
    )


def quantities(trial):
    return {"time": trial.time, **trial.commands, **trial.measurements}


def written(folder, text, name="ramp.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=40)
@given(trial=trials())
def test_what_is_written_is_read_back(suffix, trial):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"trial{suffix}"
        write_trial(trial, path)
        once = quantities(read_trial(path))
        assert set(once) == set(quantities(trial))
        for name, values in quantities(trial).items():
            # Through mm, kPa, deg a double may become a neighbour (in XLSX, whose 16 digits are off
            # by 5e-16 at most, where 2**-53 may be a double's spacing, the fifth or sixth)...
            assert_array_equal(np.isnan(once[name]), np.isnan(values))
            gap = np.abs(once[name] - values) / np.spacing(np.abs(values))
            assert np.nanmax(gap, initial=0.0) <= (6 if suffix == ".xlsx" else 1)
        write_trial(read_trial(path), path)
        for name, values in quantities(read_trial(path)).items():
            # ...and then stays what it is, where all 17 digits are kept.
            if suffix != ".xlsx":
                assert_array_equal(values, once[name])


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_the_same_trial_gives_the_same_bytes(suffix, tmp_path):
    trial = read_trial(written(tmp_path, GOOD))
    paths = [tmp_path / f"{name}{suffix}" for name in ("a", "b")]
    for path in paths:
        write_trial(trial, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_written_log_shows_the_digits_that_were_logged(tmp_path):
    path = tmp_path / "again.csv"
    write_trial(read_trial(written(tmp_path, GOOD)), path)
    assert path.read_text() == (
        "time_s,motor_voltage_v,contraction_mm\n0.0,0.0,40.0\n0.5,1.0,\n1.0,2.0,25.3\n"
    )


@pytest.mark.parametrize("suffix", [".parquet", ".xlsx"])
def test_provenance_travels_where_the_format_has_room(suffix, tmp_path):
    path = tmp_path / f"trial{suffix}"
    notes = {"model": "serres2008", "note": "2 % slack, \u00b11 mm"}
    write_trial(Trial(np.arange(2.0), {"load_command": [0, 1]}, provenance=notes), path)
    assert dict(read_trial(path).provenance) == notes


def test_a_file_is_read_in_si(tmp_path):
    text = (
        "pressure_kpa,time_s,rotation_deg,pressure_command_kpa,contraction_mm,load_n\n"
        "400,0,0,410,,12\n, 0.5 ,90,420,25,nan\n"
    )
    trial = read_trial(written(tmp_path, text))
    assert_array_equal(trial.time, [0, 0.5])
    assert_allclose(trial.commands["pressure_command"], [410e3, 420e3])
    assert_allclose(trial.measurements["pressure"], [400e3, np.nan])
    assert_allclose(trial.measurements["rotation"], [0, np.pi / 2])
    assert_allclose(trial.measurements["contraction"], [np.nan, 0.025])
    assert_array_equal(trial.measurements["load"], [12, np.nan])
    assert not trial.truth


def test_comment_lines_byte_order_mark_and_blank_lines_do_no_harm(tmp_path):
    text = '\ufeff# a log, from the "old" rig\n# model: none\n' + GOOD + "\n,,\n"
    path = written(tmp_path, text)
    assert len(read_trial(path)) == 3
    assert place_in_file(path, 2) == "row 6 of ramp.csv"
    with pytest.raises(TrialError, match="row 6 of ramp.csv has 'wide'"):
        read_trial(written(tmp_path, text.replace("25.3", "wide")))


def test_raw_sensor_volts_are_decoded_by_table_1(tmp_path):
    volts = [0.0979 * 10 - 0.881, 0.0041 * 500 + 0.0347, 1.02 * 4 + 0.027, 0.0142 * 30 + 0.087]
    later = [volts[0], volts[1], volts[2], 0.0142 * 75 + 0.087]
    header = "time_s,motor_voltage_v,lvdt_v,load_cell_v,pressure_transducer_v,potentiometer_v\n"
    rows = [",".join(map(str, [k, k, *row])) for k, row in enumerate([volts, later])]
    trial = read_trial(written(tmp_path, header + "\n".join(rows)))
    assert_allclose(trial.measurements["contraction"], 0.010)
    assert_allclose(trial.measurements["load"], 500)
    assert_allclose(trial.measurements["pressure"], 400e3)
    # The potentiometer's zero is not the trial's.
    assert_allclose(np.rad2deg(trial.measurements["rotation"]), [0, 45], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "mapping", "message"),
    [
        (
            "time_s,load_command_n,contration_mm,phase,\n0,0,1,a,\n1,1,2,b,\n", None,
            r"^ramp.csv: unknown columns are ignored: 'contration_mm' \(did you mean "
            r"'contraction_mm'\?\), 'phase'$",
        ),
        (
            GOOD, {"Time_s": "time_s"},
            r"lacks columns that \[columns\] maps: 'Time_s' \(did you mean 'time_s'\?\)",
        ),
    ],
)  # fmt: skip
def test_columns_that_are_not_what_they_seem_are_named(tmp_path, text, mapping, message):
    with pytest.warns(TrialWarning, match=message):
        assert len(read_trial(written(tmp_path, text), mapping)) > 1


def test_a_time_that_may_not_be_seconds_is_doubted(tmp_path):
    rows = "".join(f"{k},{k}\n" for k in range(1923))
    message = r"ramp.csv: time_s spans 1922 s, 1 s from row to row .*; trials last up to 600 s"
    with pytest.warns(TrialWarning, match=message + ".* milliseconds or sample numbers, divide"):
        read_trial(written(tmp_path, "time_s,load_command_n\n" + rows))
    mapping = {"time_s": {"name": "time_s", "factor": 1 / 384}}
    assert len(read_trial(written(tmp_path, "time_s,load_command_n\n" + rows), mapping)) == 1923


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "^ramp.csv is empty; a trial needs a header with time_s and a command"),
        ("\n\n", "ramp.csv is empty"),
        ("time_s,motor_voltage_v\n", "ramp.csv has a header but no rows; a trial needs"),
        (
            "Time_S,motor_voltage_v\n0,1\n",
            r"no column time_s; its columns are 'Time_S' \(did you mean 'time_s'\?\); rename one",
        ),
        ("motor_voltage_v\n0\n", "no column time_s; its columns are motor_voltage_v;"),
        ("time_s,load_n\n0,1\n", "ramp.csv needs at least one command, motor_voltage_v or"),
        (
            GOOD.replace("25.3", "wide"),
            "contraction_mm must hold numbers, row 4 of ramp.csv has 'wide'; leave the cell empty",
        ),
        (GOOD.replace("25.3", "1_000"), "row 4 of ramp.csv has '1_000'"),
        (
            GOOD.replace("25.3", '"25,3"'),
            "row 4 of ramp.csv has '25,3'; write it with a decimal point",
        ),
        (
            GOOD.replace("0.5,1", "10:02:07,1"),
            "time_s must hold numbers, row 3 .* has '10:02:07'; give seconds since the start",
        ),
        (GOOD.replace("0.5,1", ",1"), "time_s must be .* seconds, row 3 of ramp.csv has none"),
        (
            GOOD.replace("0.5,1", "1.5,1"),
            "time_s must increase strictly, row 4 of ramp.csv has 1.0 s after 1.5 s; ",
        ),
        (
            GOOD.replace("0.5,1", "0.5,12.4"),
            "^motor_voltage_v must lie in 0-10 V, row 3 of ramp.csv has 12.4; if it is a "
            r"controller's output before its saturation, .*, limit = \[0, 10\] }$",
        ),
        (
            GOOD.replace("40", "inf"),
            "must hold numbers, row 2 of ramp.csv has 'inf'; leave",
        ),
        (GOOD.replace("40", "1e999"), "must hold numbers, row 2 of ramp.csv has '1e999'"),
        (
            "time_s,load_command_n,load_n,load_n\n0,1,2,3\n",
            "ramp.csv has the column 'load_n' twice; rename or remove one",
        ),
        (
            "time_s,load_command_n,load_n,load_cell_v\n0,1,2,3\n",
            "ramp.csv has load twice, in columns 'load_n' and 'load_cell_v'",
        ),
        (
            "time_s,load_command_n,lvdt_v\n0,1,2048\n",
            "lvdt_v must lie in -10 to 10 V, row 2 of ramp.csv has 2048.0; .* DAQ counts",
        ),
        (GOOD.replace("25.3", "25,3"), "row 4 of ramp.csv has 4 cells, its header has 3; .*comma"),
        (GOOD[: GOOD.rindex(",2")], "row 4 of ramp.csv has 2 cells, its header has 3; complete"),
        ('time_s,load_n\n0,"' + "x" * 200_000, "ramp.csv, row 2: .*is it a CSV file"),
    ],
)
def test_a_csv_file_that_cannot_be_used(text, message, tmp_path):
    with pytest.raises(TrialError, match=message):
        read_trial(written(tmp_path, text))


def test_readings_at_an_end_of_a_range_are_not_measured(tmp_path):
    text = "time_s,motor_voltage_v,F,lvdt_v\n0,1,0,1\n1,1,49,9.9951\n2,1,50,2\n3,1,51,-10\n"
    with pytest.warns(TrialWarning) as warned:
        trial = read_trial(
            written(tmp_path, text), {"F": {"name": "load_n", "range": [0, 50]}}
        ).measurements
    assert np.array_equal(np.isnan(trial["load"]), [True, False, True, True])
    assert np.array_equal(np.isnan(trial["contraction"]), [False, True, False, True])
    said = sorted(str(each.message) for each in warned)
    assert (
        "'F' (load_n) is at an end of its range, 0 to 50 N, in 3 of 4 rows, row 2 to row 5"
        in (said[0])
    )
    assert "lvdt_v is at an end of its range, -9.99268 to 9.99268 V, in 2 of 4 rows" in said[1]


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"a": "tme_s"}, r"'a' must name one of time_s, .*, got 'tme_s' \(did you mean 'time_s'"),
        ({"a": {"factor": 2.0}}, "'a' must name one of .*, got 'a'"),
        (
            {"a": {"name": "load_n", "scale": 2}},
            "takes name, factor, offset, range and limit, got 'scale'",
        ),
        ({"a": {"name": "load_n", "factor": "2"}}, "'a' factor must be a finite number, got '2'"),
        ({"a": {"name": "load_n", "offset": np.nan}}, "'a' offset must be a finite number, got na"),
        ({"a": {"name": "load_n", "factor": 0}}, "'a' factor must not be 0"),
        ({"a": "contraction_mm"}, "contraction twice, in columns 'contraction_mm' and 'a'"),
        ({"a": {"name": "load_n", "range": 5}}, r"range must be two numbers in N.*range = \[0, 50"),
        ({"a": {"name": "load_n", "range": [5, 0]}}, r"range must grow, .*, got \[5, 0\]"),
        ({"a": {"name": "load_command_n", "range": [0, 5]}}, "but load_command_n is no measure"),
    ],
)
def test_a_mapping_that_cannot_be_used(mapping, message, tmp_path):
    text = GOOD.replace("\n", ",0\n").replace("mm,0", "mm,a")
    with pytest.raises(TrialError, match=message):
        read_trial(written(tmp_path, text), mapping)


@pytest.mark.parametrize("suffix", [".parquet", ".xlsx"])
def test_a_damaged_file_is_named(suffix, tmp_path):
    path = tmp_path / f"trial{suffix}"
    with pytest.raises(TrialError, match=f"trial{suffix} is empty"):
        read_trial(written(tmp_path, "", path.name))
    with pytest.raises(TrialError, match=f"trial{suffix} cannot be read: damaged"):
        read_trial(written(tmp_path, "time_s,load_n\n", path.name))
    write_trial(Trial(np.arange(3.0), {"load_command": np.arange(3.0)}), path)
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(TrialError, match=f"trial{suffix} cannot be read: damaged"):
        read_trial(path)


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        ("wide", "'wide'"),
        (datetime.datetime(2008, 1, 1), "'2008-01-01 00:00:00'"),
        (True, "T"),
    ],
)
def test_text_and_dates_in_a_spreadsheet_are_named(tmp_path, cell, shown):
    book = pytest.importorskip("openpyxl").Workbook()
    for row in (["time_s", "load_command_n", "load_n"], [0, 1, None], [1, 1, cell]):
        book.active.append(row)
    book.save(tmp_path / "ramp.xlsx")
    message = f"load_n must hold numbers, row 3 of ramp.xlsx has {shown}"
    with pytest.raises(TrialError, match=message):
        read_trial(tmp_path / "ramp.xlsx")


def test_text_in_parquet_is_named(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    columns = {"time_s": [0, 1], "load_command_n": [1, None], "load_n": ["2", "wide"]}
    parquet.write_table(pyarrow.table(columns), tmp_path / "ramp.parquet")
    with pytest.raises(
        TrialError, match="load_n must hold numbers, row 2 of ramp.parquet has 'wide"
    ):
        read_trial(tmp_path / "ramp.parquet")


@pytest.mark.parametrize(("suffix", "library"), [(".parquet", "pyarrow"), (".xlsx", "openpyxl")])
def test_a_missing_library_is_named_with_what_to_install(suffix, library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    path = written(tmp_path, "x", f"trial{suffix}")
    message = rf'{library}, which .* needs, is not installed: pip install "pma-gym\[files\]"'
    if suffix != ".xlsx":
        with pytest.raises(TrialError, match=message):
            parquet.read(path.read_bytes(), path.name, Request())
    with pytest.raises(TrialError, match=message):
        write_trial(Trial([0.0], {"load_command": [0.0]}), path)
    assert path.read_text() == "x"


@pytest.mark.parametrize(
    ("act", "name", "message"),
    [
        ("read", "ramp.doc", r"ramp.doc must end in .csv, .txt, .*, got '.doc'"),
        ("read", "none.csv", "there is no file .*none.csv; check the name"),
        ("write", "ramp.txt", r"ramp.txt must end in .csv, .parquet, .xlsx, got '.txt'"),
        ("write", "ramp", "got 'no suffix'; save it in one of these"),
        ("write", "results/ramp.csv", "cannot write .*: there is no folder .*results; name a"),
        ("write", "folder.csv", "folder.csv is a folder"),
    ],
)
def test_suffixes_and_folders_that_do_not_exist(tmp_path, act, name, message):
    (tmp_path / "folder.csv").mkdir()
    there = {"folder.csv", written(tmp_path, GOOD, "ramp.doc").name}
    with pytest.raises(TrialError, match=message):
        if act == "read":
            read_trial(tmp_path / name)
        else:
            write_trial(Trial([0.0], {"load_command": [0.0]}), tmp_path / name)
    assert {entry.name for entry in tmp_path.iterdir()} == there


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(suffix, tmp_path, monkeypatch):
    path = tmp_path / f"ramp{suffix}"
    write_trial(Trial([0.0], {"load_command": [0.0]}), path)
    before = path.read_bytes()

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(trial_files.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_trial(Trial([0.0], {"load_command": [1.0]}), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
