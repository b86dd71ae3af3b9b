"""Old module names import, with one warning that says the new one."""

import importlib
import pickle
import sys
import warnings
from pathlib import Path

import pytest

import pma_gym
from pma_gym.engine.options import Options
from pma_gym.renamed_modules import RENAMED_MODULES


@pytest.fixture
def forgotten(monkeypatch):
    """No old name has been imported yet in this process."""
    for old in RENAMED_MODULES:
        monkeypatch.delitem(sys.modules, old, raising=False)


@pytest.mark.parametrize("old", RENAMED_MODULES)
def test_an_old_name_gives_the_new_modules_names_and_warns_once(old, forgotten):
    new = RENAMED_MODULES[old]
    if new.startswith("pma_gym.sb3"):
        pytest.importorskip("stable_baselines3")
    with pytest.warns(DeprecationWarning, match=f"module {old} is now {new};") as said:
        module = importlib.import_module(old)
    assert len(said) == 1
    there = importlib.import_module(new)
    assert module.__all__
    assert all(getattr(module, name) is getattr(there, name) for name in module.__all__)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert importlib.import_module(old) is module


def test_a_pickle_that_names_an_old_module_loads(forgotten):
    """In the oldest format, where names are text without a length."""
    new = pickle.dumps(Options, 0)
    old = new.replace(b"pma_gym.engine.options", b"pma_gym.envs.options")
    assert old != new
    with pytest.warns(DeprecationWarning, match="pma_gym.engine.options"):
        assert pickle.loads(old) is Options


def test_no_file_stands_in_the_place_of_an_old_name():
    package = Path(pma_gym.__file__).parent.parent
    for old, new in RENAMED_MODULES.items():
        assert not (package / old.replace(".", "/")).with_suffix(".py").exists()
        assert (package / new.replace(".", "/")).with_suffix(".py").exists()
