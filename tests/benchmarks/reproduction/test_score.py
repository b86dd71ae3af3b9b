"""Scores are the dissertation's own: its printed trials, scored, give its printed tables."""

import numpy as np
import pytest

from benchmarks.reproduction.replay import ReplayError, summarise, table_angle
from benchmarks.reproduction.targets import Check
from benchmarks.runner.phase_score import PHASES, measured_score, score_trial
from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.data.trial import Trial
from pma_gym.data.trial_schedule import SCHEDULES
from pma_gym.metrics import PHASE_SAMPLES, SAMPLE_RATE_HZ, phase_times, rmse_from_regression
from pma_gym.studies.trials import measured_regression
from pma_gym.units import SI_FACTORS


def trial_of(task, pressure):
    """A trial with the slope, intercept and residual that the tables print."""
    schedule = SCHEDULES[task]
    samples = round(schedule.phases[-1].start * SAMPLE_RATE_HZ) + PHASE_SAMPLES
    position = np.empty(samples)
    for phase in schedule.phases:
        line = measured_regression(phase.name, pressure)
        own = phase_times()
        wiggle = np.cos(40.0 * own)
        wiggle -= np.polyval(np.polyfit(own, wiggle, 1), own)
        wiggle *= np.sqrt(line.ss_error / np.sum(wiggle**2))
        first = round(phase.start * SAMPLE_RATE_HZ)
        position[first : first + PHASE_SAMPLES] = line.intercept + line.slope * own + wiggle
    time = np.arange(samples) / SAMPLE_RATE_HZ
    truth = {schedule.quantity: position * SI_FACTORS[schedule.unit]}
    return Trial(time, {"motor_voltage": np.zeros(samples)}, truth=truth)


@pytest.mark.parametrize("pressure", pressures("displacement"))
def test_a_printed_displacement_trial_scores_its_printed_figures(pressure):
    figures = score_trial(trial_of("displacement", pressure), "displacement")["displacement"]
    printed = load_table("22").where(pressure_kpa=pressure)
    assert figures.rmse == pytest.approx(printed["rmse_mm"][0], abs=0.011)
    estimates = load_table("21").where(pressure_kpa=pressure)
    assert (figures.intercept, figures.slope) == pytest.approx(tuple(estimates["estimate"]))
    errors = (figures.intercept_std_error, figures.slope_std_error)
    assert errors == pytest.approx(tuple(estimates["std_error"]), rel=2e-3)
    ss_error = load_table("20").where(pressure_kpa=pressure)["ss_error"][0]
    assert figures.ss_error == pytest.approx(ss_error, rel=1e-6)


@pytest.mark.parametrize("pressure", pressures("rotation"))
def test_a_printed_rotation_trial_scores_its_printed_figures_in_the_last_phase(pressure):
    # Phases overlap by 3 samples, so that only the last of a written trial is whole.
    figures = score_trial(trial_of("rotation", pressure), "rotation")
    assert tuple(figures) == PHASES["rotation"]
    printed = load_table("30").where(pressure_kpa=pressure)
    assert figures["III"].rmse == pytest.approx(printed["phase_iii_deg"][0], abs=0.011)
    for phase in ("I", "II"):
        line = measured_regression(phase, pressure)
        assert figures[phase].slope == pytest.approx(line.slope, abs=0.02)


def test_measured_scores_are_the_printed_ones():
    score = measured_score("displacement", "displacement", 150)
    assert (score.rmse, score.percent_of_range) == pytest.approx((1.92, 7.68))
    line = measured_regression("displacement", 150)
    assert rmse_from_regression(line, 5.0) == pytest.approx(score.rmse, abs=0.011)
    assert score.mean == pytest.approx(-0.823263 + 5.2561355 * 2.5)
    score = measured_score("rotation", "III", 275)
    assert (score.rmse, score.percent_of_range) == pytest.approx((4.13, 4.59), abs=0.005)


@pytest.mark.parametrize("task", PHASES)
def test_line_part_and_scatter_make_up_every_printed_rmse(task):
    """RMSE^2 = line^2 + scatter^2: tables 20, 21 and 24-29 give the RMSE of tables 22 and 30."""
    for phase in PHASES[task]:
        for pressure in pressures(task):
            score = measured_score(task, phase, pressure)
            # Slopes, intercepts and RMSEs are rounded in print.
            whole = np.hypot(score.line_error, score.scatter)
            assert whole == pytest.approx(score.rmse, abs=0.012)


def test_line_part_and_scatter_are_what_their_names_say():
    trial = trial_of("displacement", 150)
    score = score_trial(trial, "displacement")["displacement"]
    time, extension = trial.time, 1e3 * trial.truth["extension"]
    line = np.polyval(np.polyfit(time, extension, 1), time)
    assert score.line_error == pytest.approx(np.sqrt(np.mean((line - 5.0 * time) ** 2)))
    assert score.scatter == pytest.approx(np.std(extension - line))
    assert np.hypot(score.line_error, score.scatter) == pytest.approx(score.rmse, rel=1e-9)


def test_table_i3_goes_further_than_the_trials_did():
    """Below 500 kPa it gives 100-104 deg for the voltages that held 85-93 deg."""
    for pressure in (275, 300, 350, 400, 450):
        angle, extrapolated = table_angle(pressure)
        assert 100.0 < angle < 104.0
        assert 85.0 < measured_score("rotation", "II", pressure).mean < 93.0
        assert not extrapolated
    assert table_angle(575).extrapolated


def test_means_of_signed_errors_cancel_and_absolute_ones_do_not():
    errors = [
        ReplayError(
            "displacement", "displacement", pressure, sign * 0.1, sign * 1.0, 0.0, 0.5, 0.3, -0.4
        )
        for pressure, sign in ((150, 1.0), (200, -1.0))
    ]
    summary = summarise(errors)
    assert summary.signed["slope"] == 0.0
    assert summary.absolute["slope"] == pytest.approx(0.1)
    assert summary.absolute["rmse"] == 0.5
    assert (summary.signed["scatter"], summary.absolute["scatter"]) == (-0.4, 0.4)
    assert summary.trials == 2


def test_verdicts():
    assert Check("x", 0.1, 0.1, "mm").verdict == "met"
    assert Check("x", 0.1, 0.1, "mm", strict=True).verdict == "missed"
    assert Check("x", 0.1, 0.2, "mm").verdict == "missed"
    assert Check("x", 0.1, None, "mm").verdict == "no figure"
    assert Check("x", 0.1, float("nan"), "mm").verdict == "missed"
