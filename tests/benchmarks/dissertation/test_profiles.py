from importlib import resources

import pytest

from benchmarks.dissertation import run_profiles, write_csv

SHIPPED = resources.files("pma_gym.data.serres2008") / "tables_I4_I20_voltage_profiles.csv"


def test_the_profiles_are_the_shipped_file_byte_for_byte(tmp_path):
    out = tmp_path / "new folder" / "profiles.csv"
    assert run_profiles(out) == 842
    assert out.read_bytes() == SHIPPED.read_bytes()
    assert [path.name for path in out.parent.iterdir()] == ["profiles.csv"]


def test_a_file_that_cannot_be_replaced_leaves_nothing_behind(tmp_path):
    out = tmp_path / "taken"
    out.mkdir()
    with pytest.raises(OSError):
        write_csv(out, ("a",), [("1",)])
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
