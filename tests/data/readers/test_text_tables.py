"""Text files as laboratories have them: what is read, and fixes that work when followed."""

import re
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import TrialWarning, place_in_file, read_trial
from pma_gym.data.readers.table import FileFormat
from pma_gym.data.trial import TrialError

HEADER = ["time_s", "motor_voltage_v", "contraction_mm", "load_n"]
ROWS = 40
TIME = np.arange(ROWS) / 50
VALUES = np.column_stack(
    [TIME, 4 * np.sin(TIME) ** 2, 40.25 - 20 * np.sin(TIME) ** 2, 1.5 + 400.5 * np.sin(TIME) ** 2]
).round(4)


def lines(separator=",", decimal=".", header=HEADER):
    rows = [[str(value).replace(".", decimal) for value in row] for row in VALUES.tolist()]
    return [separator.join(row) for row in [header, *rows]]


def text(*args, **kwargs):
    return "\n".join(lines(*args, **kwargs)) + "\n"


def save(folder, content, name="ramp.csv"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def spoiled(value, row=3, column=3):
    """The file with one cell replaced, or of all rows where the row is a slice."""
    cells = [line.split(",") for line in lines()]
    for each in cells[row] if isinstance(row, slice) else [cells[row]]:
        each[column] = value
    return "\n".join(map(",".join, cells))


def described(folder, line):
    """The trials of a data set with a line in its description."""
    (folder / "dataset.toml").write_text(line)
    return [each.trial for each in read_dataset(folder).trials]


def check(trial):
    """All rows, in SI."""
    assert_allclose(trial.time, VALUES[:, 0] - VALUES[0, 0], atol=1e-9)
    assert_allclose(trial.commands["motor_voltage"], VALUES[:, 1])
    assert_allclose(trial.measurements["contraction"], VALUES[:, 2] / 1e3)
    assert_allclose(trial.measurements["load"], VALUES[:, 3])


def refused(folder, content, form=None, columns=None, name="ramp.csv"):
    with warnings.catch_warnings(), pytest.raises(TrialError) as caught:
        warnings.simplefilter("ignore", TrialWarning)
        read_trial(save(folder, content, name), columns, form)
    return str(caught.value)


@pytest.mark.parametrize(
    ("separator", "decimal", "name"),
    [
        *((",", ".", name) for name in ("a.csv", "a.txt", "a.tsv", "a.dat", "A.CSV")),
        *((";", mark, "a.csv") for mark in ".,"),
        *(("\t", mark, "a.txt") for mark in ".,"),
        *((mark, ".", "a.dat") for mark in ("|", "   ")),
    ],
)
def test_any_separator_and_decimal_mark(tmp_path, separator, decimal, name):
    check(read_trial(save(tmp_path, text(separator, decimal), name)))


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp1252"]
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_any_encoding_and_line_end(tmp_path, encoding, end):
    header = [*HEADER[:3], "Kraft (N) bei 20 °C"]
    content = text(header=header).replace("\n", end).encode(encoding)
    check(read_trial(save(tmp_path, content), {header[3]: "load_n"}))


def test_an_encoding_is_given_where_none_can_be_told(tmp_path):
    content = text(header=[*HEADER[:3], "Сила"]).encode("koi8-r")
    check(read_trial(save(tmp_path, content), {"Сила": "load_n"}, FileFormat(encoding="koi8-r")))
    assert "is not utf-8 text (byte" in refused(tmp_path, content, FileFormat(encoding="utf-8"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize("count", [1, 512, 513])
def test_zero_bytes_of_a_power_cut_are_passed_over_and_counted(tmp_path, encoding, count):
    content = text().encode(encoding) + b"\0" * count
    with pytest.warns(TrialWarning, match=f"{count} zero bytes behind row {ROWS + 1}, as a loss"):
        check(read_trial(save(tmp_path, content)))


def test_a_row_that_a_power_cut_ended_early_is_passed_over(tmp_path):
    content = (text() + "0.8,1.97").encode() + b"\0" * 9
    with pytest.warns(TrialWarning, match=f"9 zero bytes behind row {ROWS + 2}.*so is that row"):
        check(read_trial(save(tmp_path, content)))


@pytest.mark.parametrize("minus", "\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d")
@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ",")])
def test_every_minus_is_one(tmp_path, minus, separator, decimal):
    content = text(separator, decimal).replace(f"{separator}1{decimal}5\n", f"{separator}-1e-2\n")
    assert read_trial(save(tmp_path, content.replace("-", minus))).measurements["load"][0] == -0.01


@pytest.mark.parametrize("factor", [1.0, 1.3])
def test_a_command_beyond_its_drive_is_clipped_by_the_line_of_the_message(tmp_path, factor):
    theirs = 13 / factor * np.sin(8 * TIME) ** 4
    rows = [f"{t},{v!r},{40 - t}" for t, v in zip(TIME, theirs.tolist(), strict=True)]
    entry = {"u": {"name": "motor_voltage_v", "factor": factor}}
    message = refused(tmp_path, "\n".join(["time_s,u,contraction_mm", *rows]), columns=entry)
    assert "before its saturation" in message and "in place of F" not in message
    with pytest.warns(TrialWarning, match="u lies beyond limit, 0 to 10 V, in .* it is clipped"):
        (trial,) = described(tmp_path, "[columns]\n" + message.partition("toml ")[2])
    assert_allclose(trial.commands["motor_voltage"], np.clip(factor * theirs, 0, 10))


def test_counts_of_a_converter_get_a_factor_and_no_limit(tmp_path):
    counts = [f"{t},{v},{40 - t}" for t, v in zip(TIME, range(0, 4000, 100), strict=True)]
    message = refused(tmp_path, "\n".join([",".join(HEADER[:3]), *counts]))
    assert "looks like raw DAQ counts" in message and "limit" not in message
    line = message.partition("toml ")[2].partition(" with")[0].replace("F", "0.0025")
    (trial,) = described(tmp_path, f"[columns]\n{line}")
    assert trial.commands["motor_voltage"][-1] == 9.75
    percent = [f"{t},{100 * t / 0.78 + 0.5!r},40" for t in TIME.tolist()]
    both = refused(tmp_path, "\n".join([",".join(HEADER[:3]), *percent]))
    assert "if it is a controller's output" in both and "if it is in another unit" in both


@pytest.mark.parametrize(
    "units", ["s,V,mm,N", "[s],[V],[mm],[N]", "(s),(V),(mm),(N)", "seconds,Volt,mm,-"]
)
def test_a_row_of_units_that_agrees_is_read_over(tmp_path, units):
    rows = lines()
    check(read_trial(save(tmp_path, "\n".join([rows[0], units, *rows[1:]]))))
    again = "\n".join(["x", rows[0], "Time,Motor,Position,Force", units, *rows[1:]])
    with pytest.warns(TrialWarning) as said:
        check(read_trial(save(tmp_path, again)))
    assert len(said) == 2


def test_a_unit_that_differs_is_refused_with_a_line_that_works(tmp_path):
    first, *rows = lines()
    other = refused(tmp_path, "\n".join([first, "s,V,V,N", *rows]))
    assert "the factor in place of 2" in other
    message = refused(tmp_path, "\n".join([first, "s,V,cm,N", *rows]))
    assert "gives 'contraction_mm' the unit 'cm', but contraction_mm is in mm" in message
    (trial,) = described(tmp_path, "[columns]\n" + message.partition("toml: ")[2])
    assert_allclose(trial.measurements["contraction"], VALUES[:, 2] / 1e2)


def test_titles_footers_and_remarks_are_named(tmp_path):
    rows = lines()
    content = ["Test of March", "Operator: N. N., rig 2", "", *rows[:9], "# paused", *rows[9:]]
    content += ["", "End of file", "Mean,2.0,30.0,200.0"]
    with pytest.warns(TrialWarning) as said:
        trial = read_trial(save(tmp_path, "\n".join(content)))
    check(trial)
    shown = sorted(str(each.message) for each in said)
    assert shown == [
        "ramp.csv: row 13 ('# paused') is passed over as remarks",
        "ramp.csv: rows 1 to 2 ('Test of March'...) above the header are passed over",
        f"ramp.csv: rows {ROWS + 7} to {ROWS + 8} ('End of file'...) below the samples are passed "
        "over",
    ]  # fmt: skip
    assert place_in_file(tmp_path / "ramp.csv", 0) == "row 5 of ramp.csv"
    assert place_in_file(tmp_path / "ramp.csv", ROWS - 1) == f"row {ROWS + 5} of ramp.csv"


def test_a_header_behind_a_mark_of_remarks_is_one(tmp_path):
    np.savetxt(tmp_path / "a.txt", VALUES, header=" ".join(HEADER))
    check(read_trial(tmp_path / "a.txt"))
    np.savetxt(tmp_path / "a.csv", VALUES, header=",".join(HEADER), delimiter=",")
    check(read_trial(tmp_path / "a.csv"))


def test_a_row_in_the_midst_that_is_no_sample_is_refused_and_may_be_marked(tmp_path):
    rows = lines()
    rows.insert(9, "valve opened")
    message = refused(tmp_path, "\n".join(rows))
    assert "row 10 of ramp.csv is no sample, it has 'valve opened'" in message
    assert message.endswith("remove the row, or let it begin with #")
    rows[9] = "# valve opened"
    with pytest.warns(TrialWarning, match="row 10 .* is passed over"):
        check(read_trial(save(tmp_path, "\n".join(rows))))
    rows[9] = rows[0]
    assert "it is the header again: split the file there" in refused(tmp_path, "\n".join(rows))


def test_a_file_without_a_header_is_refused_and_both_fixes_work(tmp_path):
    body = "\n".join(lines()[1:])
    message = refused(tmp_path, body)
    assert "ramp.csv has no header: row 1, its first, holds numbers" in message
    assert "insert a row above it with the names of its 4 columns" in message
    check(described(tmp_path, f"[format]\nnames = {HEADER!r}")[0])
    check(read_trial(save(tmp_path, ",".join(HEADER) + "\n" + body)))


def test_a_header_row_may_be_named(tmp_path):
    rows = ["a,b,c,d", *lines()]
    with pytest.warns(TrialWarning, match="row 1 .'a'. above the header"):
        check(read_trial(save(tmp_path, "\n".join(rows)), form=FileFormat(header_row=2)))
    assert "has no such row" in refused(tmp_path, "\n".join(rows), FileFormat(header_row=99))


def test_repeated_rows_are_left_out_where_time_then_increases(tmp_path):
    rows = lines()
    for again in (30, 20, 10):
        rows.insert(again + 1, rows[again])
    twice = lines() + lines()[1:]
    for written, match in (
        (twice, f"{ROWS} rows repeat an earlier one"),
        (rows, "3 rows repeat an earlier one .*: row 12, 23, 34"),
    ):
        with pytest.warns(TrialWarning, match=match):
            check(read_trial(save(tmp_path, "\n".join(written))))
    assert place_in_file(tmp_path / "ramp.csv", ROWS - 1) == f"row {ROWS + 4} of ramp.csv"
    rows[11] += "1"
    assert "must increase strictly" in refused(tmp_path, "\n".join(rows))


def test_empty_columns_rows_and_separators_at_the_end_do_no_harm(tmp_path):
    rows = [f"{row},," for row in lines()]
    content = "\n\n".join([*rows, ",,,,,"])
    check(read_trial(save(tmp_path, content)))
    with pytest.warns(TrialWarning, match="unknown columns are ignored: column 5, which has no na"):
        check(read_trial(save(tmp_path, "\n".join([rows[0], *[f"{r[:-1]}7" for r in rows[1:]]]))))


@pytest.mark.parametrize("group", [",", "'", "\u2019", "\u00a0", "\u202f", " ", "German"])
def test_grouped_thousands_are_read_where_they_have_one_meaning(tmp_path, group):
    rows = lines(";", "," if group == "German" else ".")
    number = "1.234,5" if group == "German" else f"1{group}234.5"
    rows[5] = f"{rows[5].rpartition(';')[0]};{number}"
    assert read_trial(save(tmp_path, "\n".join(rows))).measurements["load"][4] == 1234.5


@pytest.mark.parametrize(
    ("decimal", "value", "line"),
    [(".", 3785.0, "a decimal point"), (",", 3.785, "a decimal comma")],
)
def test_a_comma_of_two_meanings_is_refused_and_the_fix_works(tmp_path, decimal, value, line):
    rows = ["time_s;motor_voltage_v;load_n", *[f"{k};1;3,{785 + k}" for k in range(9)]]
    message = refused(tmp_path, "\n".join(rows))
    assert "row 2 of ramp.csv has '3,785'; it may have a decimal comma or grouped" in message
    fix = re.search(rf"(decimal = \S+?)(?: under .*)? for {line}", message)
    assert fix and f'decimal = "{decimal}"' in fix[0]
    (trial,) = described(tmp_path, f'[format]\ndecimal = "{decimal}"')
    assert trial.measurements["load"][0] == value


@pytest.mark.parametrize("word", ["", "NaN", "nan", "NAN", "NA", "na", " nan "])
def test_exact_words_for_not_measured(tmp_path, word):
    assert np.isnan(read_trial(save(tmp_path, spoiled(word))).measurements["load"][2])


@pytest.mark.parametrize(
    "word", ["inf", "1_000", "１２", "٣", "0x1F", "1e400", "nan(1)", "25.3 mm", "--"]
)
def test_what_is_no_number_is_refused(tmp_path, word):
    assert "load_n must hold numbers, row 4 of ramp.csv has" in refused(tmp_path, spoiled(word))
    time = refused(tmp_path, spoiled(word, column=0))
    assert "time_s must hold numbers, row 4 of" in time


READING = "it looks like a reading: write the number alone, in N"
REFUSED = {
    "a minus": (spoiled("\u2212"), "has '\u2212'; leave the cell empty"),
    "a word of a spreadsheet": (spoiled("#N/A"), "load_n must hold numbers, row 4 of ramp.csv has"),
    **{each: (spoiled(each), READING) for each in ("25.3 mm", "(15.0)", "<0.1", "1e400", "1.5*")},
    "words": (spoiled("low", slice(1, None)), "the column holds no numbers; remove or rename it"),
    "no row": (
        text().replace(".", "·").replace("time·s", "time_s"),
        "rows that can be read: row 2, column 'time_s', has '0·0', which is no number",
    ),
    "stamps": (
        "\n".join([",".join(HEADER), *(f"10:{k:02},1,2,3" for k in range(9))]),
        "clock times with seconds",
    ),
    "a known mark in many cells is no unit": (
        spoiled("-999", slice(9, 27), 2), "contraction_mm of ramp.csv is -999 in row 10, 11",
    ),
    "a mark in a command is no count of a DAQ": (
        spoiled("-999", 9, 1), "motor_voltage_v of ramp.csv is -999 in row 10",
    ),
    "zero bytes": (
        text().replace("40", "\0", 1),
        "ramp.csv holds 1 zero bytes, the first in row 2: it is no text there",
    ),
    "zero bytes alone": (b"\0" * 9, "9 zero bytes, the first in row 1"),
    "standing still": (
        "\n".join([",".join(HEADER), *["0,1,2,3"] * 20]), "must increase strictly",
    ),
    "mixed marks": (
        "time_s;motor_voltage_v;load_n\n0,5;1,25;1.234,5\n0,6;1,3;0.25",
        "has '0,5'; write it with a decimal point",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("content", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_read_is_refused_with_its_reason(tmp_path, content, message):
    said = refused(tmp_path, content)
    assert message in said and "DAQ" not in said


@pytest.mark.parametrize(
    ("mark", "count"),
    [(each, k) for each in (-999, 99999, -999.9, -6999, 32767, -32768, 1e30) for k in (1, 3)]
    + [(9999, 1), (-9999.0, 3), (7999, 1), (65535, 3), (2147483647, 1), (-5000, 3)],
)
def test_marks_of_nothing_measured_are_named_and_both_fixes_work(tmp_path, mark, count):
    def marked(value):
        rows = [line.rpartition(",")[0] + f",{value}" if i in (5, 9, 20)[:count] else line
                for i, line in enumerate(lines())]  # fmt: skip
        return "\n".join(rows)

    load = read_trial(save(tmp_path, marked(""))).measurements["load"]
    message = refused(tmp_path, marked(mark))
    assert re.match(r"load_n of ramp.csv is \S+ in row 6", message)
    assert "empty these cells" in message
    (trial,) = described(tmp_path, "[format]\n" + re.findall(r"missing = \[.*?\]", message)[0])
    for each in (load, trial.measurements["load"]):
        assert np.isnan(each).sum() == count


def test_a_signal_that_reaches_its_nines_is_no_mark(tmp_path):
    ramp = [f"{k / 50},1,5,{k * 999 / (ROWS - 1)}" for k in range(ROWS)]
    trial = read_trial(save(tmp_path, "\n".join([lines()[0], *ramp])))
    assert trial.measurements["load"][-1] == 999.0


STAMPS = {
    "ISO": lambda s: f"2026-03-01T10:59:{59 + s:09.6f}" if s < 1 else "",
    "blank": lambda s: f"2026-03-01 10:11:{12 + s:06.3f}",
    "zone": lambda s: f"2026-03-01T10:11:{12 + s:06.3f}+01:00",
    "comma": lambda s: f"2026-03-01 10:11:{12 + s:06.3f}".replace(".", ","),
    "German": lambda s: f"01.03.2026 10:11:{12 + s:06.3f}",
    "same day": lambda s: f"3/1/2026 10:11:{12 + s:06.3f} AM",
    "MATLAB": lambda s: f"01-Mar-2026 10:11:{12 + s:06.3f}",
    "clock": lambda s: f"10:11:{12 + s:06.3f}",
    "minutes": lambda s: f"{'59' if s < 0.5 else '00'}:{(59.5 + s) % 60:06.3f}",
    "hours": lambda s: f"26:00:{s:06.3f}",
    "pandas": lambda s: f"0 days 00:00:{s:09.6f}",
    "milliseconds": lambda s: f"10:11:{12 + s:06.3f}".replace(".", ":"),
    "midnight": lambda s: f"{'23:59' if s < 0.5 else '00:00'}:{(59.5 + s) % 60:06.3f}",
    "duration": lambda s: f"{s:.4g} sec",
    "epoch": lambda s: f"{1772359872 + s:.3f}",
    "epoch ms": lambda s: f"{1772359872000 + 1000 * s:.0f}",
    "epoch us": lambda s: f"{1772359872000000 + 1e6 * s:.0f}",
}


@pytest.mark.parametrize("form", [name for name in STAMPS if name != "ISO"])
def test_dates_and_clock_times_become_seconds_from_the_first_row(tmp_path, form):
    rows = [f"{STAMPS[form](float(row[0]))};" + ";".join(map(str, row[1:])) for row in VALUES]
    with pytest.warns(TrialWarning, match="from the first row"):
        trial = read_trial(save(tmp_path, "\n".join([";".join(HEADER), *rows])))
    assert_allclose(trial.time, VALUES[:, 0], atol=1e-6)


def test_a_date_of_two_meanings_is_refused(tmp_path):
    days = "time_s;load_command_n\n{} 23:59:59;1\n{} 00:00:00;1"
    for ends in (("1/2/2026", "2/2/2026"), ("1/2/2026", "1/3/2026")):
        assert "give seconds since the start" in refused(tmp_path, days.format(*ends))
    named = days.format("2026-02-01", "2026-02-02")
    with pytest.warns(TrialWarning, match="holds '2026-02-01 23:59:59' in row 2"):
        assert read_trial(save(tmp_path, named)).time.tolist() == [0.0, 1.0]
    mapping = {"time_s": {"name": "time_s", "factor": 2.0}}
    assert "no factor and no offset" in refused(tmp_path, named, None, mapping)


LVM = """LabVIEW Measurement
Writer_Version\t2
Separator\tTab
Decimal_Separator\t{decimal}
Multi_Headings\t{many}
X_Columns\t{columns}
Time_Pref\tRelative
***End_of_Header***
\t
"""
SEGMENT = """Channels\t3
Samples\t{n}\t{n}\t{n}
Y_Unit_Label\tV\tmm\tN
X_Dimension\tTime\tTime\tTime
X0\t{start}\t{start}\t{start}
Delta_X\t0{decimal}02\t0{decimal}02\t0{decimal}02
***End_of_Header***
X_Value\tmotor_voltage_v\tcontraction_mm\tload_n\tComment
"""


def labview(parts=1, decimal=".", columns="One", shift=True):
    out = LVM.format(decimal=decimal, many="Yes" if parts > 1 else "No", columns=columns)
    for part in np.array_split(np.arange(ROWS), parts):
        start = str(TIME[part[0]] if shift else 0.0).replace(".", decimal)
        out += SEGMENT.format(n=len(part), decimal=decimal, start=start)
        for i in part:
            stamp = VALUES[i, 0] - (0.0 if shift else TIME[part[0]])
            cells = [f"{stamp:.3f}" if columns != "No" else "", *map(str, VALUES[i, 1:])]
            out += "\t".join(cells).replace(".", decimal) + "\n"
        out += "\n"
    return out


@pytest.mark.parametrize("name", ["a.lvm", "a.txt", "a.csv"])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("columns", ["One", "No"])
def test_labview_files_are_read(tmp_path, name, decimal, columns):
    check(read_trial(save(tmp_path, labview(1, decimal, columns).replace("\n", "\r\n"), name)))


def test_labview_segments_that_go_on_are_one_trial_and_others_several(tmp_path):
    with pytest.warns(TrialWarning, match="its 4 segments go on in time and are read as one"):
        check(read_trial(save(tmp_path, labview(4), "a.lvm")))
    save(tmp_path, labview(2, shift=False), "a.lvm")
    with pytest.raises(TrialError, match="a.lvm holds 2 trials: 'a.lvm#1', 'a.lvm#2'; name one"):
        read_trial(tmp_path / "a.lvm")
    assert len(read_trial(tmp_path / "a.lvm#2")) == ROWS // 2
    assert [each.name for each in read_dataset(tmp_path).trials] == ["a.lvm#1", "a.lvm#2"]


def test_labview_comments_and_units_are_minded(tmp_path):
    content = labview().split("\n")
    content[20] += "\tvalve"
    with pytest.warns(TrialWarning, match="the column Comment is passed over, it is filled in ro"):
        check(read_trial(save(tmp_path, "\n".join(content), "a.lvm")))
    other = labview().replace("\tV\tmm\tN", "\tV\tm\tN")
    assert "gives 'contraction_mm' the unit 'm'" in refused(tmp_path, other, name="a.lvm")


def test_a_folder_names_what_it_passes_over(tmp_path):
    others = {
        "notes.txt": "hi\n", "old.mat": b"MATLAB 5.0", "raw.tdms": b"TDSm\0",
        "photo.png": b"\x89PNG", "~$a.xlsx": b"x", "empty.csv": b"",
    }  # fmt: skip
    for name, content in {"a.csv": text(), **others}.items():
        save(tmp_path, content, name)
    with pytest.warns(TrialWarning) as said:
        assert [each.name for each in read_dataset(tmp_path).trials] == ["a.csv"]
    shown = "\n".join(str(each.message) for each in said)
    assert [name for name in others if name not in shown] == []


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("separater = ';'", "got 'separater' (did you mean 'separator'?)"),
        ("separator = 3", "separator in [format] of dataset.toml must be one of"),
        ("decimal = ';'", "decimal in [format] of dataset.toml must be one of '.', ',', got ';'"),
        ("separator = ','\ndecimal = ','", "gives ',' as separator and as decimal; change one"),
        ("encoding = 'zip'", "encoding in [format] of dataset.toml must be the name of a text enc"),
        ("header_row = 0", "must be a row's number, counted from 1, got 0; write header_row = 3"),
        ("names = 'a'", "must be a list of texts, got 'a'"),
        ("missing = 'a'", "must be a list of numbers, got 'a'; write missing = [-999]"),
        ("missing = nan", "format.missing must be a finite number, below 1e308 in size, got nan"),
    ],
)
def test_a_format_that_cannot_be_used_is_refused(tmp_path, line, message):
    save(tmp_path, text())
    (tmp_path / "dataset.toml").write_text(f"[format]\n{line}")
    with pytest.raises(TrialError, match=re.escape(message)):
        read_dataset(tmp_path)


def test_a_time_by_another_name_and_unit_gets_its_line(tmp_path):
    message = refused(tmp_path, text(header=["t (ms)", *HEADER[1:]]))
    assert "has no column time_s; its columns are 't (ms)'" in message
    (trial,) = described(tmp_path, "[columns]\n" + message.partition("example: ")[2])
    assert_allclose(trial.time, TIME / 1e3)


@pytest.mark.parametrize(
    ("header", "other", "rows", "readings"),
    [
        ("Delta_X", "0.04", slice(None, None, 2), slice(None, ROWS // 2)),
        ("X0", "0.04", slice(2, None), slice(None, -2)),
        ("Time", "10:11:12.06", slice(2, None), slice(None, -2)),
        ("Delta_X", "0.01", slice(None), None),
        ("X0", "0.01", slice(None), None),
    ],
)
@pytest.mark.parametrize("columns", ["One", "No"])
def test_labview_channels_with_clocks_of_their_own(
    tmp_path, columns, header, other, rows, readings
):
    clock = {"Time": ["10:11:12.02"] * 3, "X0": ["0"] * 3, "Delta_X": ["0.02"] * 3}
    clock[header][1] = other
    lines = [
        line for line in labview(columns=columns).split("\n") if line.split("\t")[0] not in clock
    ]
    at = next(i for i, line in enumerate(lines) if line.startswith("Channels"))
    made = ["\t".join([name, *entries]) for name, entries in clock.items()]
    lines[at + 1 : at + 1] = ["\t".join(["Date", *["2026/03/01"] * 3]), *made]
    if readings is None:
        message = refused(tmp_path, "\n".join(lines), name="a.lvm")
        assert "'contraction_mm' has readings from" in message
        assert "s in steps of 0.02 s: the reading at 0.01 s has no row of a.lvm" in message
        return
    with pytest.warns(
        TrialWarning, match="'contraction_mm' has readings .* in the rows of their times"
    ):
        trial = read_trial(save(tmp_path, "\n".join(lines), "a.lvm"))
    expected = np.full(ROWS, np.nan)
    expected[rows] = VALUES[readings, 2] / 1e3
    assert_allclose(trial.measurements["contraction"], expected)
    assert_allclose(trial.measurements["load"], VALUES[:, 3])


def test_labview_channels_with_one_reading_or_none(tmp_path):
    lines = labview(columns="No").split("\n")
    at = next(i for i, line in enumerate(lines) if line.startswith("X_Value"))
    one = "\n".join(lines[: at + 2])
    assert read_trial(save(tmp_path, one, "a.lvm")).time.tolist() == [0.0]
    voltage, contraction, load = lines[at + 1].split("\t")[1:4]
    none = "\n".join([*lines[: at + 1], f"\t{voltage}\t\t{load}", f"\t{voltage}\t\t"])
    with pytest.warns(TrialWarning, match="'load_n' has readings from 0 to 0 s"):
        assert len(read_trial(save(tmp_path, none, "a.lvm"))) == 2


def test_labview_files_with_a_time_for_each_channel_are_read(tmp_path):
    content = labview(columns="Multi").split("\n")
    at = next(i for i, line in enumerate(content) if line.startswith("X_Value"))
    for i in range(at, at + ROWS + 1):
        first, *cells = content[i].removesuffix("\tComment").split("\t")
        content[i] = "\t".join(part for cell in cells for part in (first, cell))
    check(read_trial(save(tmp_path, "\n".join(content), "a.lvm")))
    content[at + 3] = content[at + 3].replace("\t0.040\t", "\t0.050\t", 1)
    message = refused(tmp_path, "\n".join(content), name="a.lvm")
    assert "'contraction_mm' has readings from 0" in message
    assert "the reading at 0.05 s has no row of a.lvm to stand in" in message
