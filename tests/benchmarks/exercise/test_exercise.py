"""`python -m benchmarks exercise`: what it prints and writes, and what it refuses."""

import csv

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.exercise.choose_device import SEARCHED, Choice, run_exercise
from benchmarks.exercise.profile import ProfileError, constant_prescription, read_profile
from pma_gym.plant.exercise_device.device import (
    FULL_ANGLE,
    Device,
    muscles,
    own_device,
    resistive_moment,
)
from pma_gym.plant.exercise_device.prescription import UnreachableError
from pma_gym.plant.model import load_model

PROFILE = "angle_deg,moment_nm\n0,10\n30,30\n60,30\n90,20\n"


def invoke(*words):
    return CliRunner().invoke(app, ["exercise", *words])


@pytest.fixture
def profile(tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text(PROFILE)
    return path


# -- what it writes --------------------------------------------------------------------------------


def test_tables_fit_a_terminal_and_files_are_written(tmp_path):
    with (tmp_path / "terminal.txt").open("w") as terminal:
        console = Console(file=terminal, width=80)
        assert run_exercise(Choice(), None, tmp_path / "out", console) is None
    words = (tmp_path / "terminal.txt").read_text()
    assert "1x20x250, 25.89 tested" in words and "1x40x250, 25.89 scaled" in words
    assert "275            13.02    13.86" in words and "15.63" in words
    # Nothing is cut off.
    assert "…" not in words
    assert (tmp_path / "out" / "plots" / "exercise.png").stat().st_size > 20_000
    page = (tmp_path / "out" / "report.html").read_text()
    assert "That is an extrapolation" in page and "data:image/png" in page
    assert "plots/exercise.png" in (tmp_path / "out" / "report.md").read_text()


def test_the_figures_in_the_file_are_the_studys(tmp_path):
    run_exercise(Choice("2", "40", "300", "30"), None, tmp_path, Console(quiet=True))
    with (tmp_path / "moments.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert {row["muscles"] for row in rows} == {"2"} and {row["radius_mm"] for row in rows} == {
        "30"
    }
    pressure = np.array([1e3 * float(row["pressure_kpa"]) for row in rows])
    device = Device(muscles(2, 40, 300), 0.030)
    given = resistive_moment(load_model("station"), device, pressure, FULL_ANGLE)
    assert [float(row["moment_nm"]) for row in rows] == pytest.approx(given.moment, rel=1e-5)
    assert [row["allowed"] == "1" for row in rows] == given.allowed.tolist()


@pytest.mark.parametrize(
    ("moment", "device"), [(17.0, (1, 20, 250)), (24.0, (1, 20, 200)), (150.0, (2, 40, 250))]
)
def test_the_smallest_configuration_for_a_moment(tmp_path, moment, device):
    answer = run_exercise(Choice(), constant_prescription(moment), tmp_path, Console(quiet=True))
    model = load_model("station")
    assert answer.device == Device(muscles(*device), own_device(model).radius)
    given = resistive_moment(model, answer.device, answer.setting.pressure, FULL_ANGLE).moment
    assert given == pytest.approx(moment, rel=1e-3)
    assert ("extrapolation" in answer.how) == (device != (1, 20, 250))
    assert answer.text in (tmp_path / "report.md").read_text()


def test_the_smallest_configuration_for_a_profile(tmp_path, profile):
    done = invoke("--profile", str(profile), "--out", str(tmp_path / "out"))
    assert done.exit_code == 0
    words = " ".join(done.stdout.split())
    assert "Smallest configuration: 1 muscle of 40 mm x 200 mm on a pulley of 25.89 mm" in words
    assert "the pressure following the angle (kPa): 0 deg 557," in words


def test_a_short_muscle_serves_a_profile_that_ends_early(tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text("angle_deg,moment_nm\n10,4\n30,10\n")
    answer = run_exercise(
        Choice("1", "20", "150"), read_profile(path), tmp_path, Console(quiet=True)
    )
    assert answer.device.muscles == muscles(1, 20, 150)
    device, given = answer.device, answer.setting
    angle, model = answer.prescription.angle, load_model("station")
    held_there = resistive_moment(model, device, given.pressure, angle, given.rest_pressure)
    assert held_there.moment == pytest.approx(answer.prescription.moment, rel=0.01)


def test_a_given_size_narrows_the_choice(tmp_path):
    choice, model = Choice(diameter="20"), load_model("station")
    assert {device.muscles.diameter for device in choice.searched(model)} == {0.020}
    assert len(choice.searched(model)) == len(SEARCHED["muscles"]) * len(SEARCHED["length"])
    # Six muscles of 20 mm give 148.57 N m at most.
    answer = run_exercise(choice, constant_prescription(145.0), tmp_path, Console(quiet=True))
    assert answer.device.muscles.number > 2


# -- what it refuses -------------------------------------------------------------------------------


def test_an_impossible_moment_is_refused_with_range_and_angle(tmp_path):
    done = invoke("--moment", "3000", "--out", str(tmp_path / "out"))
    assert done.exit_code == 2 and done.stdout == ""
    assert done.stderr.startswith("error: moment must lie in 462.74 to 594.29 N m at 90 deg, the ")
    assert "got 3000" in done.stderr and "(the nearest of 90 configurations)" in done.stderr
    assert not (tmp_path / "out").exists()


def test_an_impossible_profile_is_refused_with_its_angle(profile, tmp_path):
    words = ("--muscles", "1", "--diameter", "20", "--length", "250", "--out", str(tmp_path / "o"))
    done = invoke("--profile", str(profile), *words)
    assert done.exit_code == 2 and not (tmp_path / "o").exists()
    assert " N m at 30 deg, the range of 1 muscle of 20 mm x 250 mm on a pulley" in done.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--muscles", "0"), "--muscles must be a whole number in 1 to 100, got 0.0; give"),
        (("--muscles", "two"), "--muscles must be a number, or several by commas, got 'two'; for"),
        (("--diameter", "0.02"), "--diameter must lie in 5 to 80 mm, got 0.02; check unit"),
        (("--length", "nan"), "--length must be a number, or several by commas, got 'nan'; for"),
        (("--radius", "1"), "--radius must lie in 5 to 300 mm, got 1.0; check unit"),
        (("--moment", "-3"), "--moment must lie above 0, to 10000 N m, got -3.0; give"),
        (("--moment", "3", "--profile", "x.csv"), "--moment and --profile are two prescriptions"),
        (("--profile", "none.csv"), "--profile none.csv: No such file or directory; name a CSV"),
        (("--length", "150", "--moment", "9"), "9 N m at 90 deg: no pressure of the model allows"),
    ],
)
def test_options_that_cannot_be_used_are_refused(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = invoke(*words)
    assert done.exit_code == 2 and done.stdout == ""
    assert done.stderr.startswith(f"error: {message}") and done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_file_as_folder_is_refused(profile):
    done = invoke("--out", str(profile))
    assert done.exit_code == 2
    assert done.stderr == f"error: --out {profile} is a file; name a folder for the results\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must have the columns angle_deg and moment_nm, got an empty file"),
        ("angle,moment\n0,1\n", "must have the columns angle_deg and moment_nm, got angle, moment"),
        ("angle_deg,moment_nm\n", "has no rows below its header"),
        ("angle_deg,moment_nm\n0,1\n95,1\n", r"angle_deg must be a number in 0 to 90 deg, row 3 "),
        ("angle_deg,moment_nm\n0,-1\n", "moment_nm must be a number in 0 to 10000 N m, row 2 of"),
        ("angle_deg,moment_nm\n0,ten\n", "has 'ten'; check unit, sign and decimal point"),
        ("angle_deg,moment_nm\n0\n", "moment_nm must be a number .* has None"),
        ("angle_deg,moment_nm\n9,1\n3,1\n", "angle_deg must increase from row to row, row 3 .* 3 "),
    ],
)
def test_a_profile_that_cannot_be_read_is_refused(text, message, tmp_path):
    path = tmp_path / "profile.csv"
    path.write_text(text)
    with pytest.raises(ProfileError, match=message):
        read_profile(path)


def test_a_profile_is_filled_by_lines(profile):
    read = read_profile(profile)
    degrees = np.degrees(read.angle)
    assert np.max(np.diff(degrees)) < 5.001 and len(degrees) == 19
    assert read.moment[np.isclose(degrees, 15.0)] == pytest.approx(20.0)


def test_one_row_is_a_profile_too(tmp_path):
    path = tmp_path / "one.csv"
    path.write_text("angle_deg, moment_nm\n45,12\n")
    assert read_profile(path).moment.tolist() == [12.0]


def test_the_error_of_the_library_is_a_value_error():
    assert issubclass(UnreachableError, ValueError)
