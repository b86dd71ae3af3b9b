import math

import numpy as np
import pytest
from rich.console import Console

from pma_gym.data.files.trial_files import read_trial, write_trial
from pma_gym.data.trial import Trial, TrialError
from pma_gym.data.trial_schedule import DISPLACEMENT, ROTATION
from pma_gym.metrics import phase_times
from pma_gym.studies.evaluation import evaluate, print_evaluation

GRID = np.arange(3 * 1920 + 3) / 384


def log(time, contraction=None, rotation=None, truth=None):
    measured = {"contraction": contraction, "rotation": rotation}
    return Trial(
        time=time,
        commands={"motor_voltage": np.zeros(len(time))},
        measurements={name: values for name, values in measured.items() if values is not None},
        truth=truth or {},
    )


def residual(n, size):
    """A signal orthogonal to every line, of mean square `size`^2."""
    time = np.linspace(-1, 1, n)
    signal = 1.5 * time**2 - 0.5
    signal -= np.polyval(np.polyfit(time, signal, 1), time)
    return signal * size / math.sqrt(np.mean(signal**2))


@pytest.mark.parametrize(
    ("slope", "intercept", "ss_error", "printed_rmse", "printed_percent"),
    [
        # Tables 20-22: 150, 350 and 500 kPa.
        (5.2561355, -0.823263, 6735.46, 1.92, 7.68),
        (4.1607898, 1.8512977, 561.825, 1.35, 5.40),
        (4.7441248, 0.8604836, 463.546, 0.653, 2.61),
    ],
)
def test_a_trial_with_the_printed_line_gets_the_printed_rmse(
    slope, intercept, ss_error, printed_rmse, printed_percent
):
    own = phase_times()
    extension = intercept + slope * own + residual(own.size, math.sqrt(ss_error / own.size))
    # Extension counts from the first sample, so that one must be at 0: off the line, by 0.01 mm.
    extension[0] = 0.0
    (row,) = evaluate(log(own, contraction=0.06 - 1e-3 * extension))
    assert row.phase.name == "displacement"
    assert row.regression.slope * 1e3 == pytest.approx(slope, rel=1e-3)
    assert row.regression.intercept * 1e3 == pytest.approx(intercept, abs=0.01)
    assert row.rmse * 1e3 == pytest.approx(printed_rmse, abs=0.006)
    assert row.percent_of_range == pytest.approx(printed_percent, abs=0.025)
    assert row.note == ""
    assert row.p_value < 1e-4


def test_each_phase_of_a_rotation_is_its_own_row():
    # 275 kPa of tables 24-30: slope, intercept, SS error, RMSE.
    printed = [
        (19.36609, -9.530958, 51401.8, 8.25),
        (0.2758619, 85.367623, 8624.1102, 4.49),
        (-17.84458, 92.575187, 15833.0, 4.13),
    ]
    rotation = np.zeros(GRID.size)
    own = phase_times()
    # Backwards, so that the two samples that phases share belong to the later one.
    for k in (2, 1, 0):
        slope, intercept, ss_error, _ = printed[k]
        line = intercept + slope * own + residual(own.size, math.sqrt(ss_error / own.size))
        rotation[1920 * k : 1920 * k + own.size] = line
    rows = evaluate(log(GRID, rotation=np.deg2rad(rotation)), "rotation")
    assert [row.phase.name for row in rows] == ["I", "II", "III"]
    for row, (slope, intercept, _, printed_rmse) in zip(rows, printed, strict=True):
        assert np.rad2deg(row.regression.slope) == pytest.approx(slope, abs=0.05)
        assert np.rad2deg(row.regression.intercept) == pytest.approx(intercept, abs=0.1)
        assert np.rad2deg(row.rmse) == pytest.approx(printed_rmse, abs=0.05)
        assert row.regression.n == 1923


@pytest.mark.parametrize(("task", "quantity"), [("displacement", "extension"), ("rotation",) * 2])
def test_the_ideal_itself_has_no_error(task, quantity):
    # The last phase is scored on its line beyond the end, where the reference holds.
    ideal = {"displacement": DISPLACEMENT, "rotation": ROTATION}[task].reference(GRID)
    rows = evaluate(log(GRID, truth={quantity: ideal}), task, use_truth=True)
    assert all(row.percent_of_range < 0.01 for row in rows)


def test_another_rate_is_interpolated_and_said_so():
    time = np.arange(0, 5.011, 0.01)
    (row,) = evaluate(log(time, contraction=0.05 - 0.004 * time))
    assert row.note == "interpolated linearly to 384 Hz from samples 0.01 s apart"
    assert row.regression.slope == pytest.approx(0.004)
    assert row.regression.n == 1923


def test_a_log_of_exactly_5_s_is_scored_on_what_it_has():
    time = np.arange(0, 5.0001, 0.01)
    (row,) = evaluate(log(time, contraction=0.05 - 0.005 * time))
    assert row.regression.n == 1921
    assert row.note.endswith("1921 of 1923 samples, for the trial ends at 5 s")
    assert row.rmse < 1e-12


def test_time_counts_from_the_first_sample():
    (row,) = evaluate(log(GRID + 77.0, contraction=0.05 - 0.005 * GRID))
    assert row.rmse < 1e-10
    assert row.note == ""


def test_short_gaps_are_bridged():
    contraction = 0.05 - 0.005 * GRID
    contraction[100:150] = np.nan
    (row,) = evaluate(log(GRID, contraction=contraction))
    assert row.rmse < 1e-12
    assert row.note.startswith("interpolated")


def test_truth_is_judged_only_on_request():
    trial = log(GRID, contraction=0.05 - 0.004 * GRID, truth={"extension": 0.005 * GRID})
    assert evaluate(trial)[0].regression.slope == pytest.approx(0.004)
    assert evaluate(trial, use_truth=True)[0].regression.slope == pytest.approx(0.005)


def test_a_log_from_a_file_is_judged_the_same(tmp_path):
    trial = log(GRID, rotation=1.01 * ROTATION.reference(GRID))
    write_trial(trial, tmp_path / "log.csv")
    for row, again in zip(
        evaluate(trial, "rotation"),
        evaluate(read_trial(tmp_path / "log.csv"), "rotation"),
        strict=True,
    ):
        assert again.rmse == pytest.approx(row.rmse, rel=1e-12)
        assert again.note == row.note == ""


def broken(start, stop):
    contraction = np.full(GRID.size, 0.05)
    contraction[start:stop] = np.nan
    return contraction


@pytest.mark.parametrize(
    ("trial", "task", "use_truth", "message"),
    [
        (log(GRID, GRID), "lifting", False, "must be one of displacement, rotation, got 'lifting'"),
        (log(GRID, rotation=GRID), "displacement", False, "no contraction_mm; it has rotation_deg"),
        (log(GRID, contraction=GRID), "rotation", False, "no rotation_deg; it has contraction_mm"),
        (log(GRID, GRID), "displacement", True, "no true extension: .*use_truth=False"),
        (
            log(GRID[:1900], GRID[:1900]),
            "displacement",
            False,
            "phase displacement of the displacement task needs extension up to 5 s, the trial's "
            "last measured sample is at 4.945 s; log the whole task",
        ),
        (
            log(GRID[:2000], rotation=GRID[:2000]),
            "rotation",
            False,
            "phase II of the rotation task needs rotation up to 10 s, .* at 5.206 s",
        ),
        (
            log(GRID, broken(384, 768)),
            "displacement",
            False,
            "extension must be measured at least every 0.2 s, the trial has nothing for 1 s from "
            "0.9974 s on; log it more often",
        ),
        (log(GRID, rotation=broken(0, 200)), "rotation", False, "nothing for 0.521 s from 0 s on"),
        (log(GRID, rotation=broken(0, None)), "rotation", False, "last measured sample is at 0 s"),
        (log([0.0, 6.0], [0.0, 0.0]), "displacement", False, "nothing for 6 s from 0 s on"),
    ],
)
def test_a_trial_that_cannot_be_judged(trial, task, use_truth, message):
    with pytest.raises(TrialError, match=message):
        evaluate(trial, task, use_truth=use_truth)


def test_the_printed_table_is_in_the_units_that_people_read():
    rows = evaluate(log(GRID, rotation=1.1 * ROTATION.reference(GRID)), "rotation")
    console = Console(width=100)
    with console.capture() as capture:
        print_evaluation(rows, console)
    text = capture.get()
    for row in rows:
        assert f" {row.phase.name} " in text
        assert f"{np.rad2deg(row.regression.slope):.6g}" in text
        assert f"{row.percent_of_range:.6g}" in text
    assert "Slope (deg/s)" in text and "<0.0001" in text


def test_the_printed_table_says_what_was_interpolated():
    time = np.arange(0, 5.0001, 0.01)
    console = Console(width=100)
    with console.capture() as capture:
        print_evaluation(evaluate(log(time, contraction=0.05 - 0.005 * time)), console)
        print_evaluation([], console)
    assert "displacement: interpolated linearly to 384 Hz" in capture.get()
