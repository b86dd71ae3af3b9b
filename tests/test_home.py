"""Users without a home folder, and homes that cannot be written: what a container often has."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="users without a home are POSIX")

NO_ENTRY = """
import os, pwd
def unknown(uid):
    raise KeyError(uid)
pwd.getpwuid = unknown
"""

CODE = """
import pma_gym
from pma_gym.codegen.cache.compile_cache import _store
from pma_gym.codegen.machine.native import Library
Library("define double @one() { ret double 1.0 }")
store = _store()
print(store and store.folder.parent)
"""

STEP = """
env = pma_gym.PMAEnv("displacement", render_mode="rgb_array")
env.reset(seed=0)
env.step([0.0])
print(env.render().shape)
print(os.environ.get("MPLCONFIGDIR", ""))
"""


def run(code, cwd, **environment):
    """Standard output's lines and standard error of a fresh interpreter, which must succeed."""
    given = {k: v for k, v in os.environ.items() if k not in VARIABLES} | environment
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, env=given, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


VARIABLES = ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "PMA_GYM_CACHE", "MPLCONFIGDIR")


def test_without_a_home_the_named_cache_or_the_desktop_standards_is_used_and_nothing_said(tmp_path):
    code = f"{NO_ENTRY}{CODE}del os.environ['PMA_GYM_CACHE']{CODE}"
    caches = {"PMA_GYM_CACHE": "cache", "XDG_CACHE_HOME": str(tmp_path / "caches")}
    (named, standard), error = run(code, tmp_path, **caches)
    assert named == str(tmp_path / "cache") and error == ""
    assert standard == str(tmp_path / "caches" / "pma_gym")
    assert list((tmp_path / "cache" / "kernels").glob("*.o"))


def test_without_any_home_a_temporary_folder_serves_and_pictures_too(tmp_path):
    lines, error = run(NO_ENTRY + CODE + STEP, tmp_path, TMPDIR=str(tmp_path))
    kept, shape, matplotlib = lines
    assert error.count("UserWarning") == 1
    assert "no home folder to keep compiled plants in; compiling into a temporary folder" in error
    assert "set PMA_GYM_CACHE" in error
    assert os.path.dirname(kept) == os.path.dirname(matplotlib) == str(tmp_path)
    assert shape == "(400, 800, 3)"
    # Both folders are gone with the process.
    assert not list(tmp_path.iterdir())


def test_a_home_that_cannot_be_written_costs_one_word(tmp_path):
    # A file in place of the folder: root may write to a folder of any mode.
    (tmp_path / "home").write_bytes(b"")
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    home = str(tmp_path / "home")
    (kept,), error = run(CODE, tmp_path, HOME=home, TMPDIR=str(temporary))
    assert os.path.dirname(kept) == str(temporary)
    assert error.count("UserWarning") == 1 and f"cannot write compiled plants to {home}" in error


def test_without_any_folder_that_can_be_written_plants_compile_in_memory(tmp_path):
    code = "import tempfile\n" + (
        "def none(): raise FileNotFoundError(2, 'no usable temporary directory')\n"
        "tempfile.gettempdir = none\n"
    )
    (kept,), error = run(code + NO_ENTRY + CODE, tmp_path)
    assert kept == "None" and "compiling in memory only" in error
