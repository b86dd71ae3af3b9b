"""MAT, HDF5, TDMS and Parquet: what is read, and what is refused before memory is taken."""

import datetime
import decimal
import json
import os
import pickle
import signal
import struct
import zlib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.io import loadmat, savemat

from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.data.files.trial_files import TrialWarning, read_trial
from pma_gym.data.readers import reader_process
from pma_gym.data.readers.table import FileFormat
from pma_gym.data.trial import TrialError

ROWS = 30
TIME = np.arange(ROWS) / 50
COLUMNS = {
    "time_s": TIME,
    "motor_voltage_v": np.sin(TIME) ** 2,
    "contraction_mm": 40.0 - 5 * np.sin(TIME) ** 2,
}


SHORT = {name: values[:9] for name, values in COLUMNS.items()}


def check(trial, columns=COLUMNS):
    assert_allclose(trial.time, columns["time_s"] - columns["time_s"][0], atol=1e-9)
    assert_allclose(trial.commands["motor_voltage"], columns["motor_voltage_v"])
    assert_allclose(trial.measurements["contraction"], columns["contraction_mm"] / 1e3)


@pytest.fixture
def hdf5(tmp_path):
    """Returns a function that opens a file of a folder to write."""
    h5py = pytest.importorskip("h5py")
    return lambda name="a.h5", mode="w", **options: h5py.File(tmp_path / name, mode, **options)


@pytest.fixture
def a_mat(tmp_path):
    return tmp_path / "a.mat"


@pytest.fixture
def a_tdms(tmp_path):
    return tmp_path / "a.tdms"


@pytest.fixture
def a_parquet(tmp_path):
    return tmp_path / "a.parquet"


def refused(path, **kwargs):
    with pytest.raises(TrialError) as caught:
        read_trial(path, **kwargs)
    return str(caught.value)


@pytest.mark.parametrize(
    "options",
    [
        {"oned_as": "row"},
        {"oned_as": "column", "do_compression": True},
        {"format": "4"},
    ],
)
def test_vectors_of_a_mat_file_are_columns(tmp_path, options):
    savemat(tmp_path / "a.mat", {**COLUMNS, "fs": 50.0, "who": "N. N."}, **options)
    check(read_trial(tmp_path / "a.mat"))


@pytest.mark.parametrize("kind", ["f4", "i2", "u1", "i8", "u4"])
def test_any_numbers_of_a_mat_file_are_read_as_scipy_reads_them(a_mat, kind):
    columns = {name: np.round(9 * values).astype(kind) for name, values in COLUMNS.items()}
    columns["time_s"] = np.arange(ROWS).astype(kind)
    savemat(a_mat, columns, oned_as="row")
    trial = read_trial(a_mat)
    assert_array_equal(trial.time, loadmat(a_mat)["time_s"][0])
    there = loadmat(a_mat)["contraction_mm"][0]
    assert_allclose(trial.measurements["contraction"] * 1e3, there, rtol=1e-15)


def test_structures_of_a_mat_file_are_trials(tmp_path, a_mat):
    savemat(a_mat, {"log": {**COLUMNS, "about": {"rig": 2.0}}})
    check(read_trial(a_mat))
    savemat(a_mat, {"ramp": COLUMNS, "step": SHORT, "many": np.array([COLUMNS, SHORT], object)})
    assert "a.mat holds 2 trials: 'a.mat#ramp', 'a.mat#step'" in refused(a_mat)
    check(read_trial(f"{a_mat}#step"), SHORT)
    with pytest.warns(TrialWarning, match="'many' is passed over: a cell array"):
        assert len(read_dataset(tmp_path)) == 2
    rows = [tuple(columns.values()) for columns in (COLUMNS, SHORT)]
    savemat(a_mat, {"runs": np.array(rows, [(name, object) for name in COLUMNS])})
    check(read_trial(f"{a_mat}#runs_2"), SHORT)


def test_a_matrix_needs_names_and_takes_them(a_mat):
    savemat(a_mat, {"data": np.column_stack(list(COLUMNS.values()))})
    assert "a.mat holds 'data', but no vectors of one length with a name each" in refused(a_mat)
    check(read_trial(a_mat, form=FileFormat(names=tuple(COLUMNS))))


def test_own_names_of_a_mat_file_are_mapped(a_mat):
    names = dict(zip(("t", "U", "x"), COLUMNS, strict=True))
    savemat(a_mat, {own: COLUMNS[ours] for own, ours in names.items()})
    check(read_trial(a_mat, names))
    assert "a.mat has no column time_s; its columns are 't', 'U', 'x'" in refused(a_mat)


def element(kind, body):
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def matrix(kind, shape, name, *content):
    flags = element(6, struct.pack("<II", kind, 0))
    dims = element(5, struct.pack(f"<{len(shape)}i", *shape))
    return element(14, flags + dims + element(1, name) + b"".join(content))


OPAQUE = element(
    14,
    element(6, struct.pack("<II", 17, 0))
    + b"".join(element(1, word) for word in (b"T", b"MCOS", b"table"))
    + matrix(13, (1, 1), b"", element(6, bytes(4))),
)
MAT = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"


NAN = element(9, struct.pack("<2d", np.nan, np.nan))
DAMAGED = "a.mat cannot be read: damaged or not what its name says ("


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (OPAQUE, "'T' is a table, timetable or object of MATLAB"),
        (matrix(6, (30000, 30000), b"a", element(9, b"")), DAMAGED),
        (matrix(1, (2**31 - 1, 2**31 - 1), b"a"), DAMAGED),
        (matrix(6, (1, 3), b"a", element(9, bytes(16))), DAMAGED),
        (matrix(6, (1, -3), b"a"), DAMAGED),
        (element(14, element(6, struct.pack("<II", 6, 0)) + NAN + element(1, b"a")), DAMAGED),
        (element(14, NAN + element(5, bytes(8)) + element(1, b"a")), DAMAGED),
        (element(15, b"x"), DAMAGED),
        (element(14, b"\1"), DAMAGED),
        (element(14, bytes(20))[:-4], DAMAGED),
    ],
)
def test_a_mat_file_that_cannot_be_used_is_named_and_passed_over(tmp_path, a_mat, content, message):
    a_mat.write_bytes(MAT + content)
    assert message in refused(a_mat)
    savemat(tmp_path / "b.mat", COLUMNS)
    with pytest.warns(TrialWarning, match="a file is passed over: a.mat"):
        assert [each.name for each in read_dataset(tmp_path).trials] == ["b.mat"]


def nested_mat():
    inner = matrix(6, (1, 1), b"", element(9, bytes(8)))
    for name in [b""] * 99 + [b"a"]:
        names = element(5, struct.pack("<i", 8)) + element(1, b"a".ljust(8, b"\0"))
        inner = matrix(2, (1, 1), name, names, inner)
    return inner


def growing_mat():
    grown = matrix(6, (1, 2**24), b"a", element(9, bytes(2**27)))
    return element(15, zlib.compress(grown, 1))


@pytest.mark.parametrize(
    ("made", "limit", "number", "message"),
    [
        (
            growing_mat, "READING_MIB", 200,
            f"{DAMAGED}it takes over 200 MiB of memory; PMA_GYM_MAX_READING_MIB",
        ),
        (nested_mat, "CELLS", 10**6, "limit of 50 levels of nesting"),
        (
            lambda: matrix(6, (3, 30), b"a", element(9, bytes(720))), "CELLS", 80,
            "limit of 80 cells a table: it has 90",
        ),
    ],
)  # fmt: skip
def test_a_mat_file_without_end_is_refused(tmp_path, monkeypatch, made, limit, number, message):
    (tmp_path / "a.mat").write_bytes(MAT + made())
    monkeypatch.setenv(f"PMA_GYM_MAX_{limit}", str(number))
    assert message in refused(tmp_path / "a.mat")


def test_every_vector_that_is_passed_over_is_named(a_mat):
    others = {
        "slow": TIME[:9], "waves": np.exp(1j * TIME), "parts": np.array([TIME, 1.0], object),
        "grid": np.ones((4, 5)), "sensor": {"scale": np.arange(5.0)}, "who": "N. N.", "fs": 50.0,
    }  # fmt: skip
    savemat(a_mat, {"log": {**COLUMNS, **others}}, oned_as="row")
    with pytest.warns(TrialWarning) as said:
        check(read_trial(a_mat))
    assert sorted(str(each.message) for each in said) == [
        "a.mat: 'log.grid' is passed over: a matrix of 4 x 5, whose columns have no names",
        "a.mat: 'log.parts' is passed over: a cell array",
        "a.mat: 'log.sensor.scale' is passed over: 5 values without a time beside them",
        "a.mat: 'log.slow' is passed over: 9 values for 30 rows",
        "a.mat: 'log.waves' is passed over: complex numbers",
    ]


@pytest.mark.parametrize(
    ("name", "packed"), [("a.h5", None), ("a.hdf5", "gzip"), ("a.mat", None), ("a.mat", "gzip")]
)
def test_hdf5_and_version_73_are_read(tmp_path, hdf5, name, packed):
    """Also where links lead in circles."""
    with hdf5(name, userblock_size=512) as out:
        group = out.create_group("log")
        for column, values in COLUMNS.items():
            group.create_dataset(column, data=values[None, :], compression=packed)
        out.create_group("#refs#")["a"] = 1.0
        out["text"], out["around"], group["around"] = "N. N.", out["/"], group
    check(read_trial(tmp_path / name))


def test_hdf5_leads_nowhere_else(tmp_path, hdf5):
    import h5py

    with hdf5("other.h5") as out:
        out["contraction_mm"] = COLUMNS["contraction_mm"]
    with hdf5() as out:
        for column in ("time_s", "motor_voltage_v"):
            out[column] = COLUMNS[column]
        out["contraction_mm"] = h5py.ExternalLink("other.h5", "contraction_mm")
        out["around"] = h5py.SoftLink("/")
    assert not read_trial(tmp_path / "a.h5").measurements


@pytest.mark.parametrize(
    ("count", "shape", "options", "message"),
    [
        (1, 10**10, {"chunks": (1000,)}, "limit of 20000000 cells a table: it has 1e+10"),
        (3, 9 * 10**6, {"chunks": (1000,)}, "limit of 20000000 cells a table: it has 2.7e+07"),
        (1, 9, {"chunks": (10**8,), "maxshape": (None,)}, "limit of 256 MiB"),
    ],
)
def test_hdf5_takes_no_memory(tmp_path, hdf5, count, shape, options, message):
    with hdf5() as out:
        for k in range(count):
            out.create_dataset(f"c{k}", (shape,), "f8", compression="gzip", **options)
    assert message in refused(tmp_path / "a.h5")


def structured():
    return np.array(list(zip(*COLUMNS.values(), strict=True)), [(name, "f8") for name in COLUMNS])


def test_fields_of_a_compound_dataset_are_columns(tmp_path, hdf5):
    path = tmp_path / "a.h5"
    with hdf5() as out:
        out["log"] = structured()
    check(read_trial(path))
    with hdf5() as out:
        out["ramp"], out["step"] = structured(), structured()[:9]
        out["notes"] = np.array([(1, b"a"), (2, b"b")], [("n", "i4"), ("text", "S1")])
    check(read_trial(f"{path}#step"), SHORT)
    assert "a.h5 holds 2 trials: 'a.h5#ramp', 'a.h5#step'" in refused(path)


def test_frames_of_pandas_are_read_and_their_pickles_are_not_loaded(tmp_path, hdf5):
    """As PyTables 3.11 writes DataFrame.to_hdf, format="table" and "fixed"."""
    path = tmp_path / "a.h5"
    block = np.column_stack(list(COLUMNS.values()))
    with hdf5() as out:
        made = np.zeros(ROWS, [("index", "i8"), ("values_block_0", "f8", (3,))])
        made["values_block_0"] = block
        out["run/table"] = made
        out["run/_i_table/index/sortedLR"] = np.arange(9)
        attributes = out["run/table"].attrs
        attributes["index_kind"] = np.bytes_(b"integer")
        attributes["values_block_0_kind"] = np.bytes_(pickle.dumps(list(COLUMNS), 0))
    with pytest.warns(TrialWarning, match="unknown columns are ignored: 'index'"):
        check(read_trial(path))
    with hdf5(mode="a") as out:
        out["run/table"].attrs["values_block_0_kind"] = np.bytes_(b"cos\nabort\n(tR.")
    assert "a.h5 holds 'run', but no vectors of one length" in refused(path)
    with hdf5() as out:
        out["run/block0_values"], out["run/block0_items"] = block, np.array(list(COLUMNS), "S")
        out["run"].attrs["pandas_type"] = np.bytes_(b"frame")
    with pytest.warns(TrialWarning, match="'run.block0_items' is passed over: texts"):
        check(read_trial(path))


def test_structure_arrays_of_version_73_are_trials(a_mat, hdf5):
    import h5py

    with hdf5(a_mat.name, userblock_size=512) as out:
        out.create_group("run").attrs["MATLAB_class"] = np.bytes_(b"struct")
        for name in COLUMNS:
            refs = np.zeros((2, 1), h5py.ref_dtype)
            for k, columns in enumerate((COLUMNS, SHORT)):
                out[f"#refs#/{name}{k}"] = columns[name][None, :]
                refs[k] = out[f"#refs#/{name}{k}"].ref
            out[f"run/{name}"] = refs
        assert not out.create_dataset("run/notes", (2, 1), h5py.ref_dtype)[0, 0]
        out["cells"] = refs
        out["cells"].attrs["MATLAB_class"] = np.bytes_(b"cell")
    check(read_trial(f"{a_mat}#run_2"), SHORT)
    with pytest.warns(TrialWarning, match="'cells' is passed over: a cell array"):
        check(read_trial(f"{a_mat}#run_1"))


def test_a_file_that_ends_its_library_ends_nothing_else(tmp_path, hdf5):
    """A sound HDF5 file whose stored size of a chunk says 0: its library reads where nothing is."""
    checks = {"compression": "gzip", "shuffle": True, "fletcher32": True}
    with hdf5() as out:
        for name, values in COLUMNS.items():
            made = out.create_dataset(name, data=values, chunks=(ROWS,), **checks)
        size = struct.pack("<II", made.id.get_chunk_info(0).size, 0)
    content = bytearray((tmp_path / "a.h5").read_bytes())
    content[content.rindex(size)] = 0
    (tmp_path / "a.h5").write_bytes(content)
    savemat(tmp_path / "b.mat", COLUMNS)
    assert "a.h5 cannot be read: damaged or not what its name says (" in refused(tmp_path / "a.h5")
    with pytest.warns(TrialWarning, match="a file is passed over: a.h5 cannot be read"):
        assert len(read_dataset(tmp_path)) == 1


def reader():
    """Number of the process that reads for this one."""
    process = reader_process._READERS[os.getpid()]._process
    assert process is not None
    return process.pid


def test_one_process_reads_all_files_and_another_takes_its_place(tmp_path):
    savemat(tmp_path / "a.mat", COLUMNS)
    tdms(tmp_path / "b.tdms", {"log": COLUMNS})
    check(read_trial(tmp_path / "a.mat"))
    first = reader()
    check(read_trial(tmp_path / "b.tdms"))
    assert reader() == first
    os.kill(first, signal.SIGSEGV)
    check(read_trial(tmp_path / "a.mat"))
    assert reader() != first


def test_a_system_that_limits_no_memory_is_said_once(tmp_path, monkeypatch):
    savemat(tmp_path / "a.mat", COLUMNS)
    receive = reader_process.receive_tables
    monkeypatch.setattr(reader_process, "_READERS", {})
    monkeypatch.setattr(
        reader_process, "receive_tables", lambda stream: (receive(stream)[0], {"limited": False})
    )
    with pytest.warns(TrialWarning, match="this operating system sets a process no limit of mem"):
        check(read_trial(tmp_path / "a.mat"))
    check(read_trial(tmp_path / "a.mat"))
    reader_process._end()


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="stops a process as POSIX has it")
def test_a_file_that_takes_too_long_is_refused(tmp_path, monkeypatch):
    savemat(tmp_path / "a.mat", COLUMNS)
    check(read_trial(tmp_path / "a.mat"))
    monkeypatch.setenv("PMA_GYM_MAX_READING_S", "1")
    os.kill(reader(), signal.SIGSTOP)
    assert f"{DAMAGED}it takes over 1 s; PMA_GYM_MAX_READING_S sets more" in refused(
        tmp_path / "a.mat"
    )
    monkeypatch.undo()
    check(read_trial(tmp_path / "a.mat"))


def write_tdms(path, channels):
    """A file of channels: group, name, values, properties."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as out:
        out.write_segment([nptdms.ChannelObject(*channel) for channel in channels])


def tdms(path, groups, **properties):
    write_tdms(
        path,
        [(group, *each, properties) for group, named in groups.items() for each in named.items()],
    )


def test_channels_of_tdms_are_columns_and_groups_trials(a_tdms, capfd):
    """Odd segments at the end print nothing."""
    tdms(a_tdms, {"log": COLUMNS})
    a_tdms.write_bytes(a_tdms.read_bytes() + (b"TDSm" + struct.pack("<iIQQ", 0, 4711, 0, 0)) * 9)
    check(read_trial(a_tdms))
    assert capfd.readouterr() == ("", "")
    tdms(a_tdms, {"ramp": COLUMNS, "step": SHORT, "scale": {"a": np.arange(3.0)}})
    check(read_trial(f"{a_tdms}#step"), SHORT)
    assert "a.tdms holds 2 trials" in refused(a_tdms)


def test_waveforms_of_tdms_have_their_time(a_tdms):
    signals = {name: values for name, values in COLUMNS.items() if name != "time_s"}
    tdms(a_tdms, {"log": signals}, wf_increment=0.02, wf_start_offset=0.0)
    check(read_trial(a_tdms))
    stamps = np.datetime64("2026-03-01T10:11:12") + (TIME * 1e6).astype("timedelta64[us]")
    tdms(a_tdms, {"log": {"time_s": stamps, **signals}})
    with pytest.warns(TrialWarning, match="converted to seconds from the first row"):
        check(read_trial(a_tdms))
    tdms(a_tdms, {"log": COLUMNS}, unit_string="m")
    assert "gives 'time_s' the unit 'm'" in refused(a_tdms)


WAVE = {"wf_increment": 0.02, "wf_start_offset": 0.0, "wf_start_time": np.datetime64(0, "us")}
LATE = {"wf_start_time": np.datetime64(40_000, "us")}


def waves(path, **changed):
    """Signals as waveforms, some of them with other properties."""
    signals = [name for name in COLUMNS if name not in changed and name != "time_s"]
    channels = []
    for name in (*signals, *changed):
        properties = {k: v for k, v in (WAVE | changed.get(name, {})).items() if v is not None}
        channels.append(("log", name, COLUMNS.get(name, TIME), properties))
    write_tdms(path, channels)


@pytest.mark.parametrize(
    ("changed", "rows", "readings"),
    [
        (LATE, slice(2, None), slice(None, -2)),
        ({"wf_start_offset": -0.04}, slice(None, -2), slice(2, None)),
        ({"wf_increment": 0.04}, slice(None, None, 2), slice(None, ROWS // 2)),
        ({"wf_increment": 0.01}, slice(None), None),
        ({"wf_start_offset": 0.005}, slice(None), None),
        ({"wf_start_offset": 9.0}, slice(None), None),
        ({"wf_increment": 0.0}, slice(None), None),
        ({"wf_start_time": None}, slice(None), None),
    ],
)
def test_a_channel_with_a_clock_of_its_own_is_shifted_or_refused(a_tdms, changed, rows, readings):
    waves(a_tdms, contraction_mm=changed)
    if readings is None:
        assert "'contraction_mm' has readings " in refused(a_tdms)
    else:
        with pytest.warns(
            TrialWarning, match="'contraction_mm' has readings from .* in the rows of th"
        ):
            trial = read_trial(a_tdms)
        expected = np.full(ROWS, np.nan)
        expected[rows] = COLUMNS["contraction_mm"][readings] / 1e3
        assert_allclose(trial.measurements["contraction"], expected)
        assert_allclose(trial.time, TIME, atol=1e-9)
    waves(a_tdms, other=changed)
    with pytest.warns(TrialWarning, match="'other'"):
        check(read_trial(a_tdms))


def test_commands_have_the_clock_of_the_rows(a_tdms):
    waves(a_tdms, motor_voltage_v={"wf_start_offset": 0.04})
    with pytest.warns(TrialWarning, match="'contraction_mm' has readings from 0 to 0.58 s"):
        trial = read_trial(a_tdms)
    assert_allclose(trial.commands["motor_voltage"], COLUMNS["motor_voltage_v"])
    assert_allclose(trial.measurements["contraction"][:-2], COLUMNS["contraction_mm"][2:] / 1e3)
    waves(a_tdms, load_command_n={}, motor_voltage_v={"wf_start_offset": 0.04})
    assert "'motor_voltage_v' has readings from 0.04 to 0.62 s in steps of 0.02 s, the" in refused(
        a_tdms
    )


def test_a_time_channel_and_a_clock_that_differs_from_it(tmp_path):
    path, own = tmp_path / "a.tdms", {"wf_increment": 0.04}
    write_tdms(
        path, [("log", n, v, own if n == "contraction_mm" else {}) for n, v in COLUMNS.items()]
    )
    with pytest.warns(TrialWarning, match="15 of its 30 readings stand in the rows of their times"):
        trial = read_trial(path)
    expected = COLUMNS["contraction_mm"][: ROWS // 2] / 1e3
    assert_allclose(trial.measurements["contraction"][::2], expected)


@pytest.fixture
def parquet():
    pytest.importorskip("pyarrow")
    return pytest.importorskip("pyarrow.parquet")


def test_parquet_of_dates_decimals_and_texts_is_read(a_parquet, parquet):
    start = datetime.datetime(2026, 3, 1, 10, 11, 12, tzinfo=datetime.UTC)
    columns = {
        "time_s": [start + datetime.timedelta(seconds=t) for t in TIME.tolist()],
        "motor_voltage_v": [decimal.Decimal(f"{u:.6f}") for u in COLUMNS["motor_voltage_v"]],
        "contraction_mm": [repr(x) for x in COLUMNS["contraction_mm"].tolist()],
        "nested": [[1]] * ROWS,
    }
    table(parquet, a_parquet, columns)
    with pytest.warns(TrialWarning, match="holds dates, converted to seconds|'nested'"):
        trial = read_trial(a_parquet)
    assert_allclose(trial.time, TIME, atol=1e-9)
    assert_allclose(trial.measurements["contraction"], COLUMNS["contraction_mm"] / 1e3)


def table(parquet, path, columns=COLUMNS, metadata=None, **kwargs):
    import pyarrow as pa

    made = pa.table(columns)
    parquet.write_table(made.replace_schema_metadata(metadata), path, **kwargs)


@pytest.mark.parametrize("notes", ["[1]", "{", '"a"', "[" * 100_000, "nul", '{"a": {"b": 1}}'])
def test_provenance_that_is_none_is_passed_over(a_parquet, parquet, notes):
    table(parquet, a_parquet, metadata={"pma_gym.provenance": notes})
    with pytest.warns(TrialWarning, match="provenance (is|are) passed over"):
        trial = read_trial(a_parquet)
    check(trial)
    assert not trial.provenance
    table(parquet, a_parquet, metadata={"pma_gym.provenance": json.dumps({"seed": 1, "a": None})})
    assert dict(read_trial(a_parquet).provenance) == {"seed": "1", "a": ""}


def test_texts_of_megabytes_in_every_row_take_no_memory(a_parquet, parquet):
    import pyarrow as pa

    note = pa.DictionaryArray.from_arrays(pa.array([0] * ROWS), pa.array(["x" * 2**21]))
    table(parquet, a_parquet, {**COLUMNS, "note": note}, compression="zstd")
    with pytest.warns(TrialWarning, match="unknown columns are ignored: 'note'"):
        check(read_trial(a_parquet))
    table(parquet, a_parquet, {**COLUMNS, "load_n": note}, compression="zstd")
    assert "limit of 10000 characters a cell" in refused(a_parquet)


def test_pages_beyond_the_limit_are_not_unpacked(a_parquet, parquet, monkeypatch):
    zeros = {name: np.zeros(400_000) for name in COLUMNS}
    table(parquet, a_parquet, zeros, compression="zstd", use_dictionary=False)
    monkeypatch.setenv("PMA_GYM_MAX_TABLE_MIB", "5")
    assert "limit of 5 MiB that the tables of a packed file" in refused(a_parquet)
    monkeypatch.setenv("PMA_GYM_MAX_ROWS", "1000")
    assert "limit of 1000 rows a table: it has 400000" in refused(a_parquet)


@pytest.mark.parametrize(
    ("name", "content", "limit", "number", "message"),
    [
        (
            "a.csv",
            "x" * 2**21,
            "FILE_MIB",
            1,
            "a.csv is beyond the limit of 1 MiB a file: it has 2",
        ),
        ("a.csv", "\n" * 3000, "ROWS", 1000, "limit of 1000 rows a table: it has 3000"),
        ("a.txt", "x" * 2**21, "TEXT_MIB", 1, "limit of 1 MiB a text file"),
    ],
)
def test_a_large_text_is_refused(tmp_path, monkeypatch, name, content, limit, number, message):
    (tmp_path / name).write_text(content)
    monkeypatch.setenv(f"PMA_GYM_MAX_{limit}", str(number))
    assert message in refused(tmp_path / name)


def test_texts_that_refer_to_each_other_are_read(a_parquet, parquet):
    loads = {"load_n": [f"1{k:04}" for k in range(ROWS)]}
    encoding = {"load_n": "DELTA_BYTE_ARRAY"}
    table(parquet, a_parquet, {**COLUMNS, **loads}, use_dictionary=False, column_encoding=encoding)
    assert read_trial(a_parquet).measurements["load"][-1] == 10_029.0


def test_a_wide_file_is_refused_at_once(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    names = ["time_s", "motor_voltage_v", *[f"c{k}" for k in range(20_000)]]
    path.write_text(",".join(names) + "\n" + ",".join("1" * len(names)) + "\n")
    assert "limit of 1000 columns a table: it has 20002" in refused(path)
    monkeypatch.setenv("PMA_GYM_MAX_COLUMNS", "200000")
    with pytest.warns(TrialWarning, match="unknown columns are ignored: 'c0'.* 19960 more"):
        assert len(read_trial(path)) == 1


@pytest.mark.parametrize("name", ["zip", "none"])
def test_an_encoding_that_is_none_is_refused(tmp_path, name):
    (tmp_path / "a.csv").write_text("time_s,load_command_n\n0,1\n")
    message = refused(tmp_path / "a.csv", form=FileFormat(encoding=name))
    assert "is no encoding of text; give another" in message
