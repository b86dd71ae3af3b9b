"""`pma-gym export` writes what it says, and says what MuJoCo lacks."""

import pytest

from pma_gym.data.files.trial_files import write_trial
from pma_gym.plant.model import dump_model
from pma_gym.plant.plant import Plant
from tests.export.axes import JOINT, axis, driven, joint_friction


@pytest.fixture
def model(tmp_path):
    """A joint's file; its logs are beside it."""
    own = axis(JOINT, joint_friction=joint_friction(0.05))
    (tmp_path / "own.toml").write_text(dump_model(own))
    (tmp_path / "logs").mkdir()
    write_trial(Plant(own).simulate(driven(own)), tmp_path / "logs" / "a.csv")
    return "own.toml"


def test_each_form_is_written_where_it_says(run, model, tmp_path):
    forms = {"c": ["h", "c"], "mjcf": ["xml"]}
    for form, endings in forms.items():
        code, out, _ = run("export", model, "--to", form)
        assert (
            code == 0
            and [line.rpartition(".")[2] for line in out.split()][: len(endings)] == endings
        )
        assert all((tmp_path / line).is_file() for line in out.split())


def test_a_replay_of_logs_says_the_difference_by_effect(run, model):
    pytest.importorskip("mujoco")
    code, out, err = run("export", model, "--to", "mjcf", "--logs", "logs")
    rows = {line.rsplit(maxsplit=2)[0]: line.split()[-2:] for line in out.splitlines() if line}
    assert code == 0 and "MuJoCo has no word for joint_friction" in err
    assert float(rows["joint_friction"][0]) > 10.0
    assert float(rows["MuJoCo, without what it cannot carry"][0]) <= 1.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("station", "--to", "mjcf"), "takes a slide or a joint"),
        (("own.toml", "--start", "1,x"), "--start must be numbers such as 2,5, got '1,x'"),
        (("own.toml", "--start", "1,2"), "must be torque_command, got 2 numbers"),
        (("own.toml", "--to", "fmu", "--logs", "logs"), "--logs are replayed in MuJoCo"),
        (("own.toml", "--out", "nowhere"), "there is no folder nowhere"),
    ],
)
def test_what_cannot_be_exported_is_said(run, model, tmp_path, words, message):
    before = sorted(tmp_path.iterdir())
    code, out, err = run("export", *words)
    assert (code, out) == (2, "") and message in err
    assert sorted(tmp_path.iterdir()) == before
