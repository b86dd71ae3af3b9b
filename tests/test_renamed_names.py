"""Old names of classes and attributes work, with one warning that says the new one."""

import importlib
import sys
import warnings

import pytest

from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.suite import SUITES
from controllers.policies.document import parsed_document
from controllers.policy import shipped_policies
from pma_gym.data.trial_schedule import TrialSchedule
from pma_gym.envs import Measurement, PMAEnv, PMAVectorEnv, StationInfo
from pma_gym.plant.model import ModelError, dump_model, load_model
from pma_gym.tasks import (
    TASKS,
    MomentProfile,
    Operator,
    OperatorState,
    Task,
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


@pytest.mark.parametrize(
    ("old", "new"), [("Protocol", "TrialSchedule"), ("PROTOCOLS", "SCHEDULES")]
)
def test_an_old_name_of_a_class_or_constant_of_the_schedules_is_the_new_one(old, new):
    module = importlib.import_module("pma_gym.data.trial_schedule")
    with pytest.warns(DeprecationWarning, match=f"{old} is now {new}"):
        assert getattr(module, old) is getattr(module, new)


def test_an_import_by_the_old_module_and_class_warns_once(tmp_path, monkeypatch):
    (tmp_path / "earlier_task.py").write_text("from pma_gym.data.protocol import Protocol\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "pma_gym.data.protocol", raising=False)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        assert importlib.import_module("earlier_task").Protocol is TrialSchedule
    assert [str(one.message).split(";")[0] for one in said] == [
        "module pma_gym.data.protocol is now pma_gym.data.trial_schedule"
    ]


def test_a_task_knows_its_schedule_by_the_old_name_too():
    task, schedule = TASKS["displacement"], TASKS["displacement"].schedule
    with pytest.warns(DeprecationWarning, match="Task.protocol is now schedule"):
        assert task.protocol is schedule
    with pytest.warns(DeprecationWarning, match="is now Task"):
        assert (
            Task(task.name, protocol=schedule, lowest_pressure=150e3, highest_pressure=575e3)
            == task
        )


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


OPTIONS = [
    ({"human": "typical"}, {"operator": "typical"}, "human='typical' is now operator='typical'"),
    (
        {"disturbances": "operator"},
        {"disturbances": "hand_push"},
        "disturbances='operator' is now disturbances='hand_push'",
    ),
    (
        {"human": "typical", "disturbances": "regulator_and_operator"},
        {"operator": "typical", "disturbances": "regulator_and_hand_push"},
        "disturbances='regulator_and_operator' is now",
    ),
]
"""Options by old names, by new ones, and the warning."""


@pytest.mark.parametrize(("old", "new", "message"), OPTIONS)
def test_old_options_make_the_same_environment_with_one_warning(old, new, message):
    made = {"task": "isotonic_exercise", "model": "serres2008"}
    with pytest.warns(DeprecationWarning, match=message) as said:
        env = PMAEnv(**made, **old)
    assert len(said) == 1 and said[0].filename == __file__
    assert env.options == PMAEnv(**made, **new).options
    with pytest.warns(DeprecationWarning, match=message) as said:
        envs = PMAVectorEnv(2, **made, **old)
    assert len(said) == 1 and envs.options == env.options


def test_an_option_by_both_names_is_refused():
    with pytest.raises(TypeError, match="got operator and human, its old name; give operator"):
        PMAEnv("isotonic_exercise", human="typical", operator="random")  # pyright: ignore


def test_the_person_of_an_exercise_answers_to_the_old_name():
    env = PMAEnv("isotonic_exercise", model="serres2008", operator="typical")
    env.reset(seed=1)
    with pytest.warns(DeprecationWarning, match="PMAEnv.human is now operator"):
        assert env.human == env.operator


def test_a_model_file_with_an_old_effect_is_read(tmp_path):
    new = dump_model(load_model("station").with_effects({"hand_push": {"share": 1.0}}))
    path = tmp_path / "pushed.toml"
    path.write_text(new.replace("[hand_push]", "[operator]"))
    with pytest.warns(DeprecationWarning, match=r"\[operator\] is now \[hand_push\]") as said:
        assert dump_model(load_model(path)) == new
    assert len(said) == 1 and said[0].filename == __file__
    path.write_text(new + "\n[operator]\nshare = 1.0\n")
    with pytest.raises(ModelError, match=r"unknown effect \[operator\]"):
        load_model(path)


def test_a_suite_with_old_names_is_the_same_suite(tmp_path):
    text = (SUITES / "exercise.toml").read_text()
    path = tmp_path / "exercise.toml"
    path.write_text(text.replace("operator =", "human ="))
    with pytest.warns(DeprecationWarning, match="human='random' is now operator='random'") as said:
        old = frozen_suite(str(path))
    assert len(said) == 1
    new = frozen_suite("exercise")
    assert (old.digest, old.environment) == (new.digest, new.environment)


@pytest.mark.parametrize(
    ("suite", "digest"), [("exercise", "f428d1bb4d8a6430"), ("hard", "d79b0b05653da9d9")]
)
def test_a_new_name_is_no_new_version_of_a_suite(suite, digest):
    """The digest is of the names that it was frozen with; a new version brings a new one."""
    assert frozen_suite(suite).digest == digest


def test_a_policy_with_old_names_is_read():
    shipped = shipped_policies()
    path = next(path for path in shipped if path.stem == "displacement-50hz_delay20ms-ppo")
    text = path.read_text()
    old = text.replace("regulator_and_hand_push", "regulator_and_operator")
    with pytest.warns(DeprecationWarning, match="regulator_and_hand_push") as said:
        assert parsed_document(old.encode()) == parsed_document(text.encode())
    assert len(said) == 1 and old != text
