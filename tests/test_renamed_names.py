"""Old names of classes and attributes work, with one warning that says the new one."""

import importlib
import warnings

import pytest

from pma_gym.envs import Measurement, PMAEnv, PMAVectorEnv, StationInfo
from pma_gym.tasks import (
    MomentProfile,
    Operator,
    OperatorState,
    infeasibility_reason,
    moment_profile,
)


@pytest.mark.parametrize("module", ["pma_gym.envs", "pma_gym.envs.station_info"])
@pytest.mark.parametrize(("old", "new"), [("Station", StationInfo), ("Reading", Measurement)])
def test_an_old_class_name_is_the_new_class(module, old, new):
    with pytest.warns(DeprecationWarning, match=f"{module}.{old} is now {new.__name__}") as said:
        assert getattr(importlib.import_module(module), old) is new
    assert len(said) == 1 and said[0].filename == __file__


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Human", Operator),
        ("Plan", MomentProfile),
        ("Mind", OperatorState),
        ("plan_of", moment_profile),
        ("obstacle", infeasibility_reason),
    ],
)
def test_an_old_name_of_the_tasks_is_the_new_class(old, new):
    with pytest.warns(DeprecationWarning, match=f"pma_gym.tasks.{old} is now {new.__name__}"):
        assert getattr(importlib.import_module("pma_gym.tasks"), old) is new


def test_a_name_that_never_was_is_missing():
    with pytest.raises(AttributeError, match="'pma_gym.envs' has no attribute 'Statoin'"):
        importlib.import_module("pma_gym.envs").Statoin  # noqa: B018


def test_an_old_attribute_is_the_new_one():
    env = PMAEnv(model="serres2008", pressure_kpa=300.0)
    env.reset(seed=1)
    with pytest.warns(DeprecationWarning, match="PMAEnv.reading is now measurement") as said:
        assert env.reading == env.measurement
    assert len(said) == 1 and said[0].filename == __file__
    envs = PMAVectorEnv(2, model="serres2008", pressure_kpa=300.0)
    envs.reset(seed=1)
    with pytest.warns(DeprecationWarning, match="PMAVectorEnv.readings is now measurements"):
        old = envs.readings()
    assert old.tobytes() == envs.measurements().tobytes()


def test_a_users_file_that_imports_old_names_works(tmp_path, monkeypatch):
    (tmp_path / "earlier.py").write_text("from pma_gym.envs import Reading, Station\n")
    monkeypatch.syspath_prepend(tmp_path)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        assert importlib.import_module("earlier").Reading is Measurement
    assert [str(one.message).split()[0] for one in said] == [
        "pma_gym.envs.Reading",
        "pma_gym.envs.Station",
    ]
