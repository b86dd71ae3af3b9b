"""`pma-gym watch`: a trial in a window, or as a film; what cannot be used ends in one message."""

import pytest
from PIL import Image

from pma_gym.envs import PMAEnv
from pma_gym.tasks import TASKS, Task

MINE = """
class Half:
    def reset(self, reference, station):
        self.reference = reference

    def act(self, measurement, time):
        return 100.0 * (self.reference(time) - measurement.extension) + 1.0


class Empty:
    pass


class Broken:
    def __init__(self, gain):
        pass
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with a controller and commands, and trials of half a second."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "ramp.csv").write_text("time_s,motor_voltage_v,regulator_voltage_v\n0,0,5\n2,4,5\n")
    (tmp_path / "air.csv").write_text("time_s,regulator_voltage_v\n0,5\n2,6\n")
    whole = Task.steps
    monkeypatch.setattr(Task, "steps", lambda self, rate: min(whole(self, rate), round(rate / 2)))
    return tmp_path


def last_rmse(volts) -> str:
    """The RMSE (mm) of an episode under voltages by the environment, as the command prints it."""
    env = PMAEnv("displacement", pressure_kpa=300.0)
    env.reset(seed=0)
    over = False
    while not over:
        *_, over, info = env.step(env.action(volts(env)))
    return f"rmse_mm {info['rmse_mm']:.4g}"


def test_commands_of_a_file_are_filmed(run, folder):
    code, out, _ = run("watch", "--controller", "ramp.csv", "--video", "film.gif", "--width", 400)
    assert code == 0
    assert out.splitlines() == ["14 pictures, 0.56 s: film.gif", last_rmse(lambda e: 2.0 * e.time)]
    with Image.open(folder / "film.gif") as film:
        assert film.n_frames > 10 and film.size == (400, 200)


def test_a_film_is_an_mp4(run, folder):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    assert run("watch", "--video", "film.mp4", "--width", 400)[0] == 0
    frames = ffmpeg.read_frames(str(folder / "film.mp4"))
    facts = next(frames)
    frames.close()
    assert facts["size"] == (400, 200) and facts["fps"] == 25.0


@pytest.mark.parametrize("source", ["mine.py:Half", "mine:Half"])
def test_a_class_of_a_users_own_drives_the_window(run, source):
    pytest.importorskip("pygame")
    code, out, _ = run("watch", "--controller", source)
    reference = TASKS["displacement"].schedule.at
    volts = last_rmse(lambda e: 100.0 * (reference(e.time) - e.measurement.extension) + 1.0)
    assert (code, out.strip()) == (0, volts)


@pytest.mark.parametrize("task", ["rotation", "isotonic", "isokinetic_exercise"])
def test_without_a_controller_every_kind_of_task_moves(run, task, monkeypatch):
    moved = []
    picture = PMAEnv.picture
    monkeypatch.setattr(
        PMAEnv,
        "picture",
        lambda env: moved.append(env.regulator_voltage + env.motor_voltage) or picture(env),
    )
    assert (
        run("watch", "--task", task, "--pressure", 550, "--video", "film.gif", "--width", 400)[0]
        == 0
    )
    assert max(moved) - min(moved) > 0.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--controller", "mine.py:Hlaf"], "mine.py has no class 'Hlaf'; it has Half, Empty"),
        (["--controller", "mine.py:Empty"], "no method reset and no method act"),
        (["--controller", "mine.py:Broken"], "a controller needs no arguments"),
        (["--controller", "nobody:PID"], "a file is named with its ending, nobody.py:Class"),
        (["--controller", "nothing.py:PID"], "there is no file nothing.py"),
        (["--controller", "air.csv"], "give a column motor_voltage_v, or another --task"),
        (["--video", "film.avi"], "a film ends in .mp4 or .gif; name it film.gif"),
        (["--video", "nowhere/film.gif"], "there is no folder nowhere"),
        (
            ["--pressure", "20"],
            "pressure_kpa must be a number in 150-575 kPa ([validity] of model station), got 20.0",
        ),
        (["--task", "rotations", "--video", "a.gif"], "did you mean 'rotation'?"),
        (["--width", "401", "--video", "a.gif"], "render_width must be a multiple of 4"),
    ],
)
def test_what_cannot_be_used_ends_in_one_message(run, folder, arguments, words):
    code, out, err = run("watch", *arguments)
    assert code == 2 and out == "" and err.count("error:") == 1
    assert words in err
    assert not list(folder.glob("*.gif"))
