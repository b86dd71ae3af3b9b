"""Damaged and hostile tables: any bytes give a trial, or one message.

Every example begins with a valid file and changes it: bytes, cells, or parts of its structure, so
that many of the examples are read. `make fuzz` runs as many as PMA_GYM_FUZZ_EXAMPLES says.
"""

import io
import os
import random
import struct
import tempfile
import time
import warnings
import zipfile
import zlib
from functools import cache, partial
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pma_gym.data.files.trial_files import trial_of, write_trial
from pma_gym.data.files.trial_loading import load_tables
from pma_gym.data.readers.table import FileFormat
from pma_gym.data.trial import Trial, TrialError

EXAMPLES = int(os.environ.get("PMA_GYM_FUZZ_EXAMPLES", "25"))
LONGEST_S = 20.0
ROWS = 12

CELLS = [
    b"", b"0", b"-1", b"1e9", b"1e400", b"nan", b"NA", b"inf", b"1,5", b"1.234,5", b"3,785", b"1_0",
    "٣".encode(), b"-999", b"=1+1", b"time_s", b"#", b'"', b"10:11:12", b"2026-03-01 10:11:12.5",
    b"1/2/2026 10:11:12", b"1772359872", b"\xff", b"\0", b"x" * 300, b"9" * 500,
    b"***End_of_Header***", b"X_Value", b"Channels", b"12 mm", b"\xef\xbb\xbf", b"s",
    b"0x10", b"1'234", b"25:61:61",
]  # fmt: skip
"""What stands in cells of logs, and what should not."""


def columns():
    swing = np.sin(np.arange(ROWS)) ** 2
    return {
        "time_s": np.arange(ROWS) / 10,
        "motor_voltage_v": 4 * swing,
        "contraction_mm": 40 - 20 * swing,
        "load_n": 300 * swing,
    }


@cache
def text_seeds():
    rows = [list(columns()), *zip(*(map(str, c.tolist()) for c in columns().values()), strict=True)]
    out = []
    for separator, decimal in ((",", "."), (";", ","), ("\t", "."), (" ", "."), ("|", ".")):
        lines = [separator.join(row).replace(".", decimal) for row in rows]
        out.append("\n".join(lines).encode())
    plain = out[0].decode()
    lvm = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\n\t\nChannels\t3\nX0\t0\t0\n"
    lvm += "Delta_X\t0.1\t0.1\nY_Unit_Label\tV\tmm\tN\n***End_of_Header***\nX_Value"
    lvm += out[2].decode().removeprefix("time_s")
    clock = plain.replace("\n0.", "\n10:11:12.").replace("\n1.", "\n10:11:13.")
    out += [
        lvm.encode(),
        (lvm + "\n\n" + lvm[lvm.index("Channels") :]).encode(),
        clock.encode(),
        plain.encode("utf-16"),
        plain.encode("utf-16-le"),
        ("Test\n\n" + plain.replace("\n", "\ns,V,mm,N\n", 1) + "\nEnd").encode(),
        ("# a log\n" + plain + "\n" + plain.partition("\n")[2]).encode("cp1252"),
    ]
    return out


def made_by(write):
    """What a function writes to a file."""
    file = io.BytesIO()
    write(file)
    return file.getvalue()


@cache
def binary_seeds(suffix):
    """Valid files of a format."""
    if suffix == ".mat":
        from scipy.io import savemat

        contents = columns(), {"log": columns()}, {"a": columns(), "b": columns()}
        return [
            made_by(lambda file, c=content, p=packed: savemat(file, c, do_compression=p))
            for packed in (False, True)
            for content in contents
        ]
    if suffix in (".h5", ".73.mat"):
        return _hdf5_seeds(matlab=suffix == ".73.mat")
    if suffix == ".tdms":
        return [made_by(partial(_tdms, waveform=waveform)) for waveform in (False, True)]
    return _written(suffix)


def _tdms(file, waveform):
    """Channels with a time beside them; else, in two segments, with a clock of their own."""
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("log", name, values, properties={"wf_increment": 0.1})
        for name, values in columns().items()
        if not waveform or name != "time_s"
    ]
    with nptdms.TdmsWriter(file) as writer:
        for _ in range(1 + waveform):
            writer.write_segment(channels)


def _hdf5_seeds(matlab):
    """Files of version 7.3 with structures and arrays of them; else groups and compound tables."""
    h5py = pytest.importorskip("h5py")
    out = []
    for packing in (
        {},
        {"compression": "gzip"},
        {"compression": "gzip", "shuffle": True, "fletcher32": True, "chunks": True},
    ):
        made = io.BytesIO()
        with h5py.File(made, "w", userblock_size=512 if matlab else 0) as file:
            table = np.zeros(ROWS, [(name, "f8") for name in columns()])
            for name, values in columns().items():
                table[name] = values
                file.create_dataset(f"log/{name}", data=values[None, :], **packing)
                if matlab:
                    refs = np.zeros((1, 2), h5py.ref_dtype)
                    for k in range(2):
                        file[f"#refs#/{name}{k}"] = values[None, :]
                        refs[0, k] = file[f"#refs#/{name}{k}"].ref
                    file[f"runs/{name}"] = refs
            if matlab:
                for name in ("log", "runs"):
                    file[name].attrs["MATLAB_class"] = np.bytes_(b"struct")
            else:
                file.create_dataset("table", data=table, **packing)
                file["notes"], file["kinds"] = "N. N.", np.array([b"a", b"b"])
        out.append(made.getvalue())
    return out


def _written(suffix):
    held = columns()
    trial = Trial(
        held["time_s"],
        {"motor_voltage": held["motor_voltage_v"]},
        {"contraction": held["contraction_mm"] / 1e3, "load": held["load_n"]},
        provenance={"model": "serres2008"},
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        write_trial(trial, path)
        out = [path.read_bytes()]
    if suffix == ".parquet":
        out += _parquet_seeds()
    return out


def _parquet_seeds():
    import pyarrow
    from pyarrow import parquet

    texts = {name: list(map(str, values)) for name, values in columns().items()}
    stamps = pyarrow.array(range(0, ROWS * 10**5, 10**5), pyarrow.timestamp("us"))
    tables = map(pyarrow.table, (columns(), texts, {**columns(), "time_s": stamps}))
    return [
        made_by(lambda file, t=table, p=packed: parquet.write_table(t, file, compression=p))
        for table in tables
        for packed in ("none", "zstd")
    ]


def change_bytes(rng, content):
    """A few bytes flipped, set, removed, repeated or cut off."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        if not data:
            break
        at = rng.randrange(len(data))
        how = rng.randrange(7)
        if how == 0:
            data[at] ^= 1 << rng.randrange(8)
        elif how == 1:
            data[at] = rng.choice((0, 1, 127, 128, 255, rng.randrange(256)))
        elif how == 2:
            del data[at : at + rng.choice((1, 2, 4, 8, 64))]
        elif how == 3:
            data[at:at] = data[at : at + rng.choice((1, 4, 8, 64))]
        elif how == 4 and rng.random() < 0.2:
            del data[at:]
        elif how == 5:
            word = rng.choice((0, 1, 2**31 - 1, 2**32 - 1, 2**16, rng.randrange(2**32)))
            data[at : at + 4] = struct.pack("<I", word)
        elif how == 6:
            word = rng.choice((0, 2**63 - 1, 2**64 - 1, 2**40, rng.randrange(2**64)))
            data[at : at + 8] = struct.pack("<Q", word)
    return bytes(data)


def change_cells(rng, content):
    """Cells replaced, rows moved, repeated or removed."""
    rows = content.split(b"\n")
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(rows))
        how = rng.randrange(6)
        if how < 3:
            separator = rng.choice((b",", b";", b"\t", b" "))
            cells = rows[at].split(separator)
            cells[rng.randrange(len(cells))] = rng.choice(CELLS)
            rows[at] = separator.join(cells)
        elif how == 3:
            rows.insert(rng.randrange(len(rows)), rows[at])
        elif how == 4:
            del rows[at]
            rows = rows or [b""]
        else:
            rows.insert(at, rng.choice(CELLS))
    return b"\n".join(rows)


TOKENS = [
    b'r="XFD1"', b'r="A1048576"', b't="s"', b't="b"', b't="e"', b't="d"', b's="1"', b"<f>1</f>",
    b"<v>1</v>", b"<c/>", b"<row/>", b"</row>", b"<v>", b"1e999", b"\xc3", b"&amp;", b"<!--",
    b"]]>", b"<is><t>time_s</t></is>", b'r="a"', b"<!DOCTYPE x>", b'state="hidden"',
    b'date1904="1"',
]  # fmt: skip


def change_workbook(rng, content):
    """A part of a workbook changed, then packed again."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {info.filename: archive.read(info) for info in archive.infolist()}
    name = rng.choice(sorted(part for part in parts if part.startswith("xl/")))
    data = parts[name]
    if rng.random() < 0.4:
        data = change_bytes(rng, data)
    else:
        at = rng.choice([i for i, byte in enumerate(data) if byte in b"<> "] or [0])
        end = at if rng.random() < 0.5 else data.find(b">", at + 1) + 1 or at
        data = data[:at] + rng.choice((b" ", b"")) + rng.choice(TOKENS) + data[end:]
    parts[name] = data
    if rng.random() < 0.05:
        del parts[rng.choice(sorted(parts))]
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for part, body in parts.items():
            archive.writestr(part, body)
    return out.getvalue()


def change_mat(rng, content):
    """Bytes of a variable changed within its packing."""
    at, out = 128, content[:128]
    while at + 8 <= len(content):
        kind, size = struct.unpack_from("<II", content, at)
        body = content[at + 8 : at + 8 + size]
        at += 8 + size
        if kind == 15:
            body = zlib.compress(change_bytes(rng, zlib.decompress(body)))
        elif rng.random() < 0.5:
            body = change_bytes(rng, body)
        out += struct.pack("<II", kind, len(body)) + body
    return out


def check(suffix, content, folder, counts=None):
    """The contract of every reader."""
    path = Path(folder) / f"a{suffix}"
    path.write_bytes(content)
    began = time.monotonic()
    # A library may loop without end on a damaged file: then the limit of time ends it.
    with warnings.catch_warnings(), mock.patch.dict(os.environ, PMA_GYM_MAX_READING_S="10"):
        warnings.simplefilter("ignore")
        try:
            for table in load_tables(path):
                assert isinstance(trial_of(table, {}, FileFormat()), Trial)
            result = "read"
        except TrialError as error:
            assert str(error)
            result = "refused"
    assert time.monotonic() - began < LONGEST_S
    if counts is not None:
        counts[result] = counts.get(result, 0) + 1


CHANGES = {
    ".csv": (change_bytes, change_cells, change_cells),
    ".xlsx": (change_bytes, change_workbook, change_workbook),
    ".parquet": (change_bytes,),
    ".mat": (change_bytes, change_mat),
    ".h5": (change_bytes,),
    ".73.mat": (change_bytes,),
    ".tdms": (change_bytes,),
}


def example(suffix, seed):
    """A changed file."""
    rng = random.Random(seed)
    seeds = text_seeds() if suffix == ".csv" else binary_seeds(suffix)
    return rng.choice(CHANGES[suffix])(rng, rng.choice(seeds))


@pytest.mark.parametrize("suffix", CHANGES)
@given(seed=st.integers(0, 2**64))
@settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), database=None
)
def test_a_changed_file_is_a_trial_or_one_message(suffix, seed, tmp_path_factory):
    check(suffix, example(suffix, seed), tmp_path_factory.getbasetemp())


@pytest.mark.parametrize("suffix", CHANGES)
@given(content=st.binary(max_size=400))
@settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), database=None
)
def test_any_bytes_are_one_message(suffix, content, tmp_path_factory):
    check(suffix, content, tmp_path_factory.getbasetemp())


@pytest.mark.parametrize("suffix", CHANGES)
def test_unchanged_seeds_are_read(suffix, tmp_path):
    counts = {}
    for content in text_seeds() if suffix == ".csv" else binary_seeds(suffix):
        check(suffix, content, tmp_path, counts)
    assert counts["read"] >= counts.get("refused", 0)


@pytest.mark.parametrize(
    ("suffix", "seed"),
    [
        # pyarrow's own description of a damaged file ended the process.
        (".parquet", 213),
        # zipfile raised what it does not name: a negative place in the file.
        (".xlsx", 10515),
        (".xlsx", 16025),
    ],
)
def test_what_once_failed_is_one_message(suffix, seed, tmp_path):
    check(suffix, example(suffix, seed), tmp_path)
