"""Where a file may be written, said before anything is computed for it."""

import os
import stat
from pathlib import Path

import pytest

from pma_gym.files import OutputError, check_output, replace_file, replace_files


def test_a_file_that_can_be_written_passes_and_nothing_is_left(tmp_path):
    check_output(tmp_path / "new.csv")
    assert not list(tmp_path.iterdir())
    replace_file(tmp_path / "new.csv", b"old")
    check_output(tmp_path / "new.csv")
    assert (tmp_path / "new.csv").read_bytes() == b"old"


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


def test_a_disk_that_fills_up_leaves_all_old_files_of_a_pair(tmp_path, monkeypatch):
    pair = [tmp_path / "weights", tmp_path / "words"]
    replace_files(dict.fromkeys(pair, b"old"))
    write = Path.write_bytes

    def full(path, content):
        if "words" in path.name:
            raise OSError(28, "No space left on device")
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        replace_files(dict.fromkeys(pair, b"new"))
    assert [path.read_bytes() for path in pair] == [b"old", b"old"]
    assert sorted(tmp_path.iterdir()) == pair
