"""MAT, HDF5, TDMS and Parquet: what is read, and what is refused before memory is taken."""

import datetime
import json
import struct
import zlib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat, savemat

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import TrialWarning, read_trial
from pma_gym.data.readers.table import FileFormat
from pma_gym.data.trial import TrialError

ROWS = 30
TIME = np.arange(ROWS) / 50
COLUMNS = {
    "time_s": TIME,
    "motor_voltage_v": np.sin(TIME) ** 2,
    "contraction_mm": 40.0 - 5 * np.sin(TIME) ** 2,
}


def check(trial, columns=COLUMNS):
    assert_allclose(trial.time, columns["time_s"] - columns["time_s"][0], atol=1e-9)
    assert_allclose(trial.commands["motor_voltage"], columns["motor_voltage_v"])
    assert_allclose(trial.measurements["contraction"], columns["contraction_mm"] / 1e3)


def refused(path, **kwargs):
    with pytest.raises(TrialError) as caught:
        read_trial(path, **kwargs)
    return str(caught.value)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("shape", ["row", "column"])
def test_vectors_of_a_mat_file_are_columns(tmp_path, packed, shape):
    path = tmp_path / "a.mat"
    savemat(path, {**COLUMNS, "fs": 50.0, "who": "N. N."}, do_compression=packed, oned_as=shape)
    check(read_trial(path))


@pytest.mark.parametrize("kind", ["f4", "i2", "u1", "i8", "u4"])
def test_any_numbers_of_a_mat_file_are_read_as_scipy_reads_them(tmp_path, kind):
    path = tmp_path / "a.mat"
    columns = {name: np.round(9 * values).astype(kind) for name, values in COLUMNS.items()}
    columns["time_s"] = np.arange(ROWS).astype(kind)
    savemat(path, columns, oned_as="row")
    trial = read_trial(path)
    assert_array_equal(trial.time, loadmat(path)["time_s"][0])
    there = loadmat(path)["contraction_mm"][0]
    assert_allclose(trial.measurements["contraction"] * 1e3, there, rtol=1e-15)


def test_structures_of_a_mat_file_are_trials(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"log": {**COLUMNS, "about": {"rig": 2.0}}})
    check(read_trial(path))
    short = {name: values[:9] for name, values in COLUMNS.items()}
    savemat(path, {"ramp": COLUMNS, "step": short, "many": np.array([COLUMNS, short], object)})
    assert "a.mat holds 2 trials: 'a.mat#ramp', 'a.mat#step'" in refused(path)
    check(read_trial(f"{path}#step"), short)
    assert len(read_dataset(tmp_path)) == 2
    fields = [(name, object) for name in COLUMNS]
    array = np.array([tuple(COLUMNS.values()), tuple(short.values())], fields)
    savemat(path, {"runs": array})
    check(read_trial(f"{path}#runs_2"), short)


def test_a_matrix_needs_names_and_takes_them(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"data": np.column_stack(list(COLUMNS.values()))})
    assert "a.mat holds 'data', but no vectors of one length with a name each" in refused(path)
    check(read_trial(path, form=FileFormat(names=tuple(COLUMNS))))


def test_own_names_of_a_mat_file_are_mapped(tmp_path):
    path = tmp_path / "a.mat"
    names = dict(zip(("t", "U", "x"), COLUMNS, strict=True))
    savemat(path, {own: COLUMNS[ours] for own, ours in names.items()})
    check(read_trial(path, names))
    assert "a.mat has no column time_s; its columns are 't', 'U', 'x'" in refused(path)


def element(kind, body):
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def matrix(kind, shape, name, *content):
    flags = element(6, struct.pack("<II", kind, 0))
    dims = element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, flags + dims + element(1, name) + b"".join(content))


OPAQUE = element(14, element(6, struct.pack("<II", 17, 0)) + element(1, b"T"))
MAT = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (OPAQUE, "'T' is a table, timetable or object of MATLAB"),
        (matrix(6, (30000, 30000), b"a", element(9, b"")), "limit of 20000000 cells a table"),
        (matrix(1, (2**31 - 1, 2**31 - 1), b"a"), "limit of 20000000 cells"),
        (matrix(6, (1, 3), b"a", element(9, bytes(16))), "'a' has 2 numbers for 3"),
        (matrix(6, (1, -3), b"a"), "an array has no shape"),
        (element(15, b"x"), "is not a readable MAT file"),
        (element(14, b"\1"), "is not a readable MAT file"),
        (element(14, bytes(20))[:-4], "is not a readable MAT file"),
    ],
)
def test_a_mat_file_that_cannot_be_used(tmp_path, content, message):
    path = tmp_path / "a.mat"
    path.write_bytes(MAT + content)
    assert message in refused(path)


def test_a_mat_file_that_grows_without_end_is_refused(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(MAT + element(15, zlib.compress(bytes(2**28 + 2**20), 1)))
    assert "limit of 256 MiB that the tables" in refused(path)


def test_a_mat_file_nested_without_end_is_refused(tmp_path):
    inner = matrix(6, (1, 1), b"", element(9, bytes(8)))
    for _ in range(100):
        names = element(5, struct.pack("<i", 8)) + element(1, b"a".ljust(8, b"\0"))
        inner = matrix(2, (1, 1), b"", names, inner)
    (tmp_path / "a.mat").write_bytes(MAT + inner)
    assert "limit of 50 levels of nesting" in refused(tmp_path / "a.mat")


def test_version_4_says_how_to_save(tmp_path):
    savemat(tmp_path / "a.mat", COLUMNS, format="4")
    assert "save it in MATLAB with save(file, '-v7')" in refused(tmp_path / "a.mat")


@pytest.mark.parametrize("name", ["a.h5", "a.hdf5", "a.mat"])
@pytest.mark.parametrize("packed", [None, "gzip"])
def test_hdf5_and_version_73_are_read(tmp_path, name, packed):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / name
    with h5py.File(path, "w", userblock_size=512) as out:
        group = out.create_group("log")
        for column, values in COLUMNS.items():
            group.create_dataset(column, data=values[None, :], compression=packed)
        out.create_group("#refs#")["a"] = 1.0
        out["text"] = "N. N."
    check(read_trial(path))


def test_hdf5_leads_nowhere_else_and_takes_no_memory(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(tmp_path / "other.h5", "w") as out:
        out["contraction_mm"] = COLUMNS["contraction_mm"]
    with h5py.File(path, "w") as out:
        for column in ("time_s", "motor_voltage_v"):
            out[column] = COLUMNS[column]
        out["contraction_mm"] = h5py.ExternalLink("other.h5", "contraction_mm")
        out["around"] = h5py.SoftLink("/")
    trial = read_trial(path)
    assert not trial.measurements
    with h5py.File(path, "w") as out:
        out.create_dataset("time_s", (10**10,), "f8", chunks=(1000,), compression="gzip")
    assert "limit of 20000000 cells a table: it has 1e+10" in refused(path)
    with h5py.File(path, "w") as out:
        out.create_dataset("time_s", (9,), "f8", chunks=(10**8,), maxshape=(None,))
    assert "limit of 256 MiB" in refused(path)


def tdms(path, groups, **properties):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as out:
        out.write_segment(
            [
                nptdms.ChannelObject(group, name, values, properties=properties)
                for group, channels in groups.items()
                for name, values in channels.items()
            ]
        )


def test_channels_of_tdms_are_columns_and_groups_trials(tmp_path):
    path = tmp_path / "a.tdms"
    tdms(path, {"log": COLUMNS})
    check(read_trial(path))
    short = {name: values[:9] for name, values in COLUMNS.items()}
    tdms(path, {"ramp": COLUMNS, "step": short, "scale": {"a": np.arange(3.0)}})
    check(read_trial(f"{path}#step"), short)
    assert "a.tdms holds 2 trials" in refused(path)


def test_waveforms_of_tdms_have_their_time(tmp_path):
    path = tmp_path / "a.tdms"
    signals = {name: values for name, values in COLUMNS.items() if name != "time_s"}
    tdms(path, {"log": signals}, wf_increment=0.02, wf_start_offset=0.0)
    check(read_trial(path))
    stamps = np.datetime64("2026-03-01T10:11:12") + (TIME * 1e6).astype("timedelta64[us]")
    tdms(path, {"log": {"time_s": stamps, **signals}})
    with pytest.warns(TrialWarning, match="converted to seconds from the first row"):
        check(read_trial(path))
    tdms(path, {"log": COLUMNS}, unit_string="m")
    assert "gives 'time_s' the unit 'm'" in refused(path)


@pytest.fixture
def parquet():
    pytest.importorskip("pyarrow")
    return pytest.importorskip("pyarrow.parquet")


def test_parquet_of_dates_decimals_and_texts_is_read(tmp_path, parquet):
    import decimal

    import pyarrow as pa

    path = tmp_path / "a.parquet"
    start = datetime.datetime(2026, 3, 1, 10, 11, 12, tzinfo=datetime.UTC)
    stamps = [start + datetime.timedelta(seconds=t) for t in TIME.tolist()]
    columns = {
        "time_s": stamps,
        "motor_voltage_v": [decimal.Decimal(f"{u:.6f}") for u in COLUMNS["motor_voltage_v"]],
        "contraction_mm": [repr(x) for x in COLUMNS["contraction_mm"].tolist()],
        "nested": [[1]] * ROWS,
    }
    parquet.write_table(pa.table(columns), path)
    with pytest.warns(TrialWarning, match="holds dates, converted to seconds|'nested'"):
        trial = read_trial(path)
    assert_allclose(trial.time, TIME, atol=1e-9)
    assert_allclose(trial.measurements["contraction"], COLUMNS["contraction_mm"] / 1e3)


def table(parquet, path, columns=COLUMNS, metadata=None, **kwargs):
    import pyarrow as pa

    made = pa.table(columns)
    parquet.write_table(made.replace_schema_metadata(metadata), path, **kwargs)


@pytest.mark.parametrize("notes", ["[1]", "{", '"a"', "[" * 100_000, "nul", '{"a": {"b": 1}}'])
def test_provenance_that_is_none_is_passed_over(tmp_path, parquet, notes):
    path = tmp_path / "a.parquet"
    table(parquet, path, metadata={"pma_gym.provenance": notes})
    with pytest.warns(TrialWarning, match="provenance (is|are) passed over"):
        trial = read_trial(path)
    check(trial)
    assert not trial.provenance
    table(parquet, path, metadata={"pma_gym.provenance": json.dumps({"seed": 1, "a": None})})
    assert dict(read_trial(path).provenance) == {"seed": "1", "a": ""}


def test_texts_of_megabytes_in_every_row_take_no_memory(tmp_path, parquet):
    import pyarrow as pa

    path = tmp_path / "a.parquet"
    note = pa.DictionaryArray.from_arrays(pa.array([0] * ROWS), pa.array(["x" * 2**21]))
    table(parquet, path, {**COLUMNS, "note": note}, compression="zstd")
    with pytest.warns(TrialWarning, match="unknown columns are ignored: 'note'"):
        check(read_trial(path))
    table(parquet, path, {**COLUMNS, "load_n": note}, compression="zstd")
    assert "limit of 10000 characters a cell" in refused(path)


def test_pages_beyond_the_limit_are_not_unpacked(tmp_path, parquet, monkeypatch):
    path = tmp_path / "a.parquet"
    zeros = {name: np.zeros(400_000) for name in COLUMNS}
    table(parquet, path, zeros, compression="zstd", use_dictionary=False)
    monkeypatch.setenv("PMA_GYM_MAX_TABLE_MIB", "5")
    assert "limit of 5 MiB that the tables of a packed file" in refused(path)
    monkeypatch.setenv("PMA_GYM_MAX_ROWS", "1000")
    assert "limit of 1000 rows a table: it has 400000" in refused(path)


def test_texts_that_refer_to_each_other_are_refused(tmp_path, parquet):
    path = tmp_path / "a.parquet"
    texts = ["1" * 1000] * ROWS
    table(
        parquet,
        path,
        {**COLUMNS, "load_n": texts},
        use_dictionary=False,
        column_encoding={"load_n": "DELTA_BYTE_ARRAY"},
    )
    assert "column 4 of a.parquet holds texts that refer to each other" in refused(path)


def test_a_wide_file_is_refused_at_once(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    names = ["time_s", "motor_voltage_v", *[f"c{k}" for k in range(20_000)]]
    path.write_text(",".join(names) + "\n" + ",".join("1" * len(names)) + "\n")
    assert "limit of 1000 columns a table: it has 20002" in refused(path)
    monkeypatch.setenv("PMA_GYM_MAX_COLUMNS", "200000")
    with pytest.warns(TrialWarning, match="unknown columns are ignored: 'c0'.* 19960 more"):
        assert len(read_trial(path)) == 1


def test_a_large_file_is_not_opened(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("x" * 2**21)
    monkeypatch.setenv("PMA_GYM_MAX_FILE_MIB", "1")
    assert "a.csv is beyond the limit of 1 MiB a file: it has 2;" in refused(path)


def test_hdf5_that_links_in_circles_is_read_once(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as out:
        group = out.create_group("log")
        for column, values in COLUMNS.items():
            group[column] = values
        for name in "abc":
            group[name] = group
            out[name] = out["/"]
    check(read_trial(path))


def test_an_encoding_that_is_none_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,load_command_n\n0,1\n")
    for name in ("zip", "none"):
        message = refused(tmp_path / "a.csv", form=FileFormat(encoding=name))
        assert "is no encoding of text; give another" in message


def test_a_text_of_many_short_lines_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("\n" * 3000)
    monkeypatch.setenv("PMA_GYM_MAX_ROWS", "1000")
    assert "limit of 1000 rows a table: it has 3000" in refused(tmp_path / "a.csv")
    monkeypatch.setenv("PMA_GYM_MAX_TEXT_MIB", "1")
    (tmp_path / "a.txt").write_text("x" * 2**21)
    assert "limit of 1 MiB a text file" in refused(tmp_path / "a.txt")


def test_an_odd_tdms_file_prints_nothing(tmp_path, capfd):
    path = tmp_path / "a.tdms"
    tdms(path, {"log": COLUMNS})
    path.write_bytes(path.read_bytes() + (b"TDSm" + struct.pack("<iIQQ", 0, 4711, 0, 0)) * 9)
    check(read_trial(path))
    assert capfd.readouterr() == ("", "")
