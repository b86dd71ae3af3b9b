"""XLSX: sheets, titles, dates, formulas, and what a workbook declares but does not hold."""

import datetime
import re
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import TrialWarning, place_in_file, read_trial, write_trial
from pma_gym.data.trial import Trial, TrialError

openpyxl = pytest.importorskip("openpyxl")

HEADER = ("time_s", "motor_voltage_v", "contraction_mm")
ROWS = 20
SAMPLES = [(k / 10, k / 5, 40 - k / 2) for k in range(ROWS)]


def book(path, iso_dates=False, **sheets):
    """A workbook with rows a sheet; one with no argument has the one of the samples."""
    made = openpyxl.Workbook()
    made.iso_dates = iso_dates
    made.remove(made.active)
    for title, rows in (sheets or {"run": [HEADER, *SAMPLES]}).items():
        sheet = made.create_sheet(title)
        for row in rows:
            sheet.append(row)
    made.save(path)
    return made


@pytest.fixture
def path(tmp_path):
    """Where the workbook of a test lies."""
    return tmp_path / "a.xlsx"


def patched(path, part, change):
    """The workbook with one part of it changed."""
    with zipfile.ZipFile(path) as archive:
        parts = {info.filename: archive.read(info) for info in archive.infolist()}
    parts[part] = change(parts.get(part, b""))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)


SHEET = "xl/worksheets/sheet1.xml"
TEXTS = b"application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"


def check(trial, rows=ROWS):
    assert len(trial) == rows
    assert_allclose(trial.measurements["contraction"][-1], (40 - (rows - 1) / 2) / 1e3)


@pytest.mark.parametrize("size", ["A1:C3", "A1:A1", "A1:XFD1048576", ""])
def test_the_declared_size_of_a_sheet_is_not_trusted(path, size):
    book(path)
    patched(path, SHEET, lambda xml: re.sub(b'ref="A1:C21"', f'ref="{size}"'.encode(), xml))
    check(read_trial(path))


def test_titles_units_and_footers_are_named(path):
    rows = [("Test of March",), (), HEADER, ("s", "V", "mm"), *SAMPLES, (), ("Mean", 1.9, 35.25)]
    book(path, run=rows)
    with pytest.warns(TrialWarning) as said:
        check(read_trial(path))
    assert sorted(str(each.message) for each in said) == [
        "a.xlsx: row 1 ('Test of March') above the header is passed over",
        "a.xlsx: row 26 ('Mean') below the samples is passed over",
    ]
    assert place_in_file(path, 0) == "row 5 of a.xlsx"


def test_each_sheet_is_a_trial_of_a_data_set(tmp_path, path):
    notes = [("who", "N. N."), ("rig", 2)]
    book(path, run1=[HEADER, *SAMPLES], notes=notes, empty=[], run2=[HEADER, *SAMPLES[:9]])
    with pytest.raises(TrialError, match=r"a.xlsx holds 2 trials: 'a.xlsx#run1', 'a.xlsx#run2'"):
        read_trial(path)
    check(read_trial(tmp_path / "a.xlsx#run2"), 9)
    with pytest.raises(TrialError, match=r"no part 'run3' \(did you mean 'run2'\?\); it has"):
        read_trial(tmp_path / "a.xlsx#run3")
    (tmp_path / "dataset.toml").write_text('[trials."a.xlsx#run2"]\nrepeat_of = "a.xlsx#run1"')
    with pytest.warns(TrialWarning, match="'notes' is passed over"):
        dataset = read_dataset(tmp_path)
    assert [(each.name, len(each.trial)) for each in dataset.trials] == [
        ("a.xlsx#run1", ROWS),
        ("a.xlsx#run2", 9),
    ]
    assert dataset.trials[1].repeat_of == "a.xlsx#run1"
    (tmp_path / "dataset.toml").write_text('[trials."a.xlsx"]\norder = 1')
    with pytest.raises(TrialError, match="names the trial 'a.xlsx'.* the data set has 'a.xlsx#r"):
        read_dataset(tmp_path)


def test_hidden_sheets_are_named_and_read_where_no_other_is(path):
    made = book(path, run=[HEADER, *SAMPLES], old=[HEADER, *SAMPLES[:3]])
    made["old"].sheet_state = "hidden"
    made.save(path)
    with pytest.warns(TrialWarning, match="the hidden sheet 'old' is passed over; show it if"):
        check(read_trial(path))
    made["run"].sheet_state, made["old"].sheet_state = "hidden", "hidden"
    made.create_sheet("front")
    made.save(path)
    with pytest.raises(TrialError, match="holds 2 trials"):
        read_trial(path)


def test_formulas_without_stored_values_are_named_and_with_them_are_read(path):
    rows = [HEADER, *[(t, u, f"=A{n}*2") for n, (t, u, _) in enumerate(SAMPLES, start=2)]]
    book(path, run=rows)
    with pytest.raises(TrialError, match="cell C2 and 19 more of a.xlsx, sheet 'run', hold form"):
        read_trial(path)

    def saved_once(xml):
        return re.sub(
            rb"<f>A(\d+)\*2</f><v ?/>",
            rb"<f>A\1*2</f><v>\1</v>",
            xml.replace(b"</f><v></v>", b"</f><v/>"),
        )

    def saved_in_part(xml):
        return saved_once(xml).replace(b"<v>9</v>", b"")

    plain = path.read_bytes()
    patched(path, SHEET, saved_in_part)
    with pytest.raises(TrialError, match="cell C9 of a.xlsx, sheet 'run', hold"):
        read_trial(path)
    path.write_bytes(plain)
    patched(path, SHEET, lambda xml: saved_once(xml).replace(b'"C9"><f', b'"C9" t="str"><f', 1))
    patched(path, SHEET, lambda xml: xml.replace(b"<v>9</v>", b"<v></v>"))
    assert np.isnan(read_trial(path).measurements["contraction"]).sum() == 1
    path.write_bytes(plain)
    patched(path, SHEET, saved_once)
    assert read_trial(path).measurements["contraction"][0] == pytest.approx(2e-3)


@pytest.mark.parametrize("iso_dates", [False, True])
def test_dates_in_the_time_column_become_seconds(iso_dates, tmp_path):
    start = datetime.datetime(2026, 3, 1, 10, 11, 12)
    for k, convert in enumerate(
        (lambda t: start + datetime.timedelta(seconds=t), lambda t: datetime.timedelta(seconds=t))
    ):
        path = tmp_path / f"{k}.xlsx"
        book(path, iso_dates, run=[HEADER, *[(convert(t), u, x) for t, u, x in SAMPLES]])
        with pytest.warns(TrialWarning, match="converted to seconds from the first row"):
            trial = read_trial(path)
        assert_allclose(trial.time, [t for t, _, _ in SAMPLES], atol=1e-5)


def test_texts_of_all_kinds_are_read(path):
    """Shared texts, rich texts, cells without places: as other programs write them."""
    book(path, run=[HEADER, (0, 1, "2,5"), (1, 1, "3,5")])
    xml = (
        b'<?xml version="1.0"?><x:worksheet xmlns:x="http://schemas.openxmlformats.org/'
        b'spreadsheetml/2006/main"><x:sheetData><x:row r="2"><x:c t="s"><x:v>0</x:v></x:c>'
        b'<x:c t="s"><x:v>1</x:v></x:c><x:c r="D2" t="inlineStr"><x:is><x:r><x:t>contraction</x:t>'
        b"</x:r><x:r><x:t>_mm</x:t></x:r></x:is></x:c></x:row>"
        b'<x:row r="4"><x:c r="A4"><x:v>0</x:v></x:c><x:c t="n"><x:v>1.5E0</x:v></x:c>'
        b'<x:c r="D4" t="str"><x:f>1</x:f><x:v>2.5</x:v></x:c></x:row></x:sheetData></x:worksheet>'
    )
    texts = (
        b'<sst xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><si><t>time_s</t>'
        b'<rPh sb="0" eb="1"><t>spoken</t></rPh></si><si><r><t>motor_</t></r><r><t>voltage_v</t>'
        b"</r></si></sst>"
    )
    patched(path, SHEET, lambda _: xml)
    override = b'<Override PartName="/xl/sharedStrings.xml" ContentType="%s"/></Types>' % TEXTS
    patched(path, "[Content_Types].xml", lambda xml: xml.replace(b"</Types>", override))
    patched(path, "xl/sharedStrings.xml", lambda _: texts)
    trial = read_trial(path)
    assert trial.measurements["contraction"].tolist() == [2.5e-3]
    assert trial.commands["motor_voltage"].tolist() == [1.5]


@pytest.mark.parametrize(
    "text", ['=HYPERLINK("http://x","y")', "+1", "-1", "@sum", "#N/A", "\x01a"]
)
def test_names_in_written_workbooks_are_text(path, text):
    write_trial(Trial([0.0], {"load_command": [0.0]}, provenance={"model": text, text: "x"}), path)
    kinds = {cell.data_type for row in openpyxl.load_workbook(path)["provenance"] for cell in row}
    assert kinds == {"s"}
    assert read_trial(path).provenance["model"] == text.replace("\x01", "\ufffd")


ENTITIES = b'<!DOCTYPE x [<!ENTITY e0 "aaaaaaaaaa">%s]>' % b"".join(
    b'<!ENTITY e%d "%s">' % (k + 1, b"&e%d;" % k * 10) for k in range(15)
)
HURTS = {
    "wide": (b'<row><c r="XFD1"><v>1</v></c></row>' * 1000, "of 1000 columns a table: it has"),
    "far": (b'<row r="1048576"><c r="A1048576"><v>1</v></c></row>', "no header: row 1048576"),
    "row": (b'<row r="9999999"/>', "a.xlsx cannot be read: damaged"),
    "column": (b'<row><c r="ZZZZ1"/></row>', "a.xlsx cannot be read: damaged"),
    "no row": (b'<row r="x"/>', "a.xlsx cannot be read: damaged"),
    "cells": (
        b'<row><c r="A1"><v>1</v></c><c r="ALL1"><v>1</v></c></row>' * 500,
        "limit of 100000 cells a table",
    ),
    "large": (
        b" " * 2**21, "set the environment variable PMA_GYM_MAX_TABLE_MIB to a larger number",
    ),
    "packed": (b" " * 2**25, "limit of 100 MiB unpacked for each MiB of a workbook"),
    "entities": (b'<row><c t="inlineStr"><is><t>&e15;</t></is></c></row>', "a.xlsx cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("name", HURTS)
def test_a_workbook_that_hurts_is_refused_before_the_memory_is_taken(tmp_path, monkeypatch, name):
    path, (body, message) = tmp_path / "a.xlsx", HURTS[name]
    head = (ENTITIES if name == "entities" else b"") + (
        b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
    )
    book(path)
    patched(path, SHEET, lambda _: head + body + b"</sheetData></worksheet>")
    monkeypatch.setenv("PMA_GYM_MAX_CELLS", "100000")
    if name == "large":
        monkeypatch.setenv("PMA_GYM_MAX_TABLE_MIB", "1")
    with pytest.raises(TrialError) as caught:
        read_trial(path)
    assert message in str(caught.value)


def test_a_bare_array_of_many_rows_is_read(path):
    """A sheet as a program writes it that streams: no places, no declared size."""
    made = openpyxl.Workbook(write_only=True)
    sheet = made.create_sheet("run")
    sheet.append(HEADER)
    for k in range(3000):
        sheet.append((k / 100, 1.0, 40.0 + np.sin(k)))
    made.save(path)
    assert len(read_trial(path)) == 3000
