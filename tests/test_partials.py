"""What a killed process leaves half-written is removed by the next one, and nothing else is.

Where a file may be written, said before anything is computed for it.
"""

import os
import signal
import stat
import subprocess
import sys
import time

import pytest

from pma_gym import partials
from pma_gym.files import OutputError, check_output, replace_file
from pma_gym.partials import begin_partial, clean_folder, end_partial, is_leftover

posix = pytest.mark.skipif(os.name != "posix", reason="processes are asked for by signals")

WRITER = """
import pathlib, sys, time
from pma_gym.files import replace_file
def write(path, content):
    with open(path, "wb") as file:
        file.write(content[:1000]); file.flush()
        print(path.name, flush=True)
        time.sleep(600)
pathlib.Path.write_bytes = write
replace_file(pathlib.Path(sys.argv[1]) / "scores.csv", b"x" * 2000)
"""


@pytest.fixture
def writer(tmp_path):
    """A process in the middle of writing scores.csv."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    process.partial = tmp_path / process.stdout.readline().strip()
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@posix
def test_the_file_of_a_killed_writer_goes_with_the_next_write(writer, tmp_path):
    (tmp_path / "other.csv").write_bytes(b"1")
    replace_file(tmp_path / "scores.csv", b"of another process")
    # The writer lives.
    assert names(tmp_path) == sorted([writer.partial.name, "other.csv", "scores.csv"])
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    assert writer.partial.read_bytes() == b"x" * 1000
    replace_file(tmp_path / "log.txt", b"any file of the folder")
    assert names(tmp_path) == ["log.txt", "other.csv", "scores.csv"]
    assert (tmp_path / "scores.csv").read_bytes() == b"of another process"


@posix
def test_a_killed_process_that_nobody_waited_for_is_dead(writer):
    os.kill(writer.pid, signal.SIGKILL)
    until = time.monotonic() + 60
    while not is_leftover(writer.partial) and time.monotonic() < until:
        time.sleep(0.01)
    assert is_leftover(writer.partial)


def test_what_this_process_writes_is_no_leftover(tmp_path):
    partial = begin_partial(tmp_path / "x")
    partial.write_bytes(b"1")
    clean_folder(tmp_path)
    assert names(tmp_path) == [partial.name]
    end_partial(partial)
    assert names(tmp_path) == []
    # The number of this process, but of one that ran before it.
    partial.write_bytes(b"1")
    clean_folder(tmp_path)
    assert names(tmp_path) == ([] if os.name == "posix" else [partial.name])


@pytest.mark.parametrize(
    "name",
    [
        ".x.csv.0a1b2c3d-1-0a1b2c3d.partial",
        ".x.csv.0a1b2c3d.partial",
    ],
)
def test_what_another_machine_writes_is_a_leftover_after_a_day(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"1")
    assert not is_leftover(path)
    now = time.time()
    os.utime(path, (now, now - 86300))
    assert not is_leftover(path)
    os.utime(path, (now, now - 86500))
    assert is_leftover(path)
    clean_folder(tmp_path)
    assert not path.exists()


@pytest.mark.parametrize(
    "name",
    ["x.partial", ".partial", "gains.partial.json", ".x.partial", "x.0a1b2c3d.partial", ".x.0a1b"],
)
def test_files_of_other_names_are_the_users(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"1")
    os.utime(path, (0, 0))
    clean_folder(tmp_path)
    assert path.exists()


@posix
def test_a_folder_and_a_link_are_removed_and_nothing_behind_the_link(tmp_path):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").write_bytes(b"1")
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    form = f"{partials._machine()}-{dead.pid}-0a1b2c3d.partial"
    folder, link = tmp_path / f".000001.{form}", tmp_path / f".link.{form}"
    folder.mkdir()
    (folder / "state.json").write_bytes(b"{}")
    link.symlink_to(tmp_path / "kept")
    clean_folder(tmp_path)
    assert names(tmp_path) == ["kept"] and (tmp_path / "kept" / "file").exists()


def test_a_folder_that_does_not_exist_is_clean(tmp_path):
    clean_folder(tmp_path / "none")


def test_a_name_as_long_as_the_file_system_allows_can_be_written(tmp_path):
    path = tmp_path / ("\N{GREEK SMALL LETTER OMEGA}" * 120 + ".csv")
    replace_file(path, b"1")
    assert path.read_bytes() == b"1" and len(names(tmp_path)) == 1


def test_a_folder_that_allows_no_files_is_refused(tmp_path, monkeypatch):
    def denied(dir):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pma_gym.files.tempfile.TemporaryFile", denied)
    message = r"no file can be made in the folder .* \(Permission denied\); name a file in another"
    with pytest.raises(OutputError, match=message):
        check_output(tmp_path / "new.csv")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write all")
def test_a_protected_file_is_refused(tmp_path):
    path = tmp_path / "kept.csv"
    path.touch()
    path.chmod(stat.S_IRUSR)
    with pytest.raises(OutputError, match="write-protected; name another, or allow writing"):
        check_output(path)
