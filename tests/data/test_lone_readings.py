"""Outliers: single readings that stand alone are found and said; what a rig does is none."""

import numpy as np
import pytest

from pma_gym.data.quality.lone_readings import without_lone_readings
from pma_gym.data.trial import Trial

NOISE = 1e-4
TIME = np.arange(1500) / 128.0


def trial_of(contraction, command=None):
    command = np.sin(TIME) + 2.0 if command is None else command
    commands = {"motor_voltage": command, "regulator_voltage": np.full(TIME.size, 5.0)}
    return Trial(TIME, commands, {"contraction": contraction})


def quiet(seed):
    return 0.02 + 0.01 * np.sin(TIME) + NOISE * np.random.default_rng(seed).normal(size=TIME.size)


def test_readings_that_stand_alone_are_taken_out_and_counted():
    rows = np.random.default_rng(1).choice(np.arange(5, 1495, 7), 8, replace=False)
    row = quiet(0)
    row[rows] += 12.0 * NOISE * np.array([1.0, -1.0] * 4)
    (kept,), (words,) = without_lone_readings([trial_of(row)])
    assert np.array_equal(np.flatnonzero(np.isnan(kept.measurements["contraction"])), np.sort(rows))
    assert words.startswith("contraction_mm: 8 of 1500 readings stand alone, ")
    assert words.endswith("count as not measured")


def test_gaussian_noise_has_none():
    for seed in range(40):
        (kept,), words = without_lone_readings([trial_of(quiet(seed))])
        assert words == []
        assert np.isfinite(kept.measurements["contraction"]).all()


@pytest.mark.parametrize("size", [15.0, 40.0, 400.0])
def test_what_a_rig_does_is_no_outlier(size):
    """A step, a stick that slips, a beat of three rows, and a jump that a command makes."""
    motions = {
        "step": np.where(TIME > 5.0, size, 0.0),
        "ramp": np.clip(128.0 * size * (TIME - 5.0) / 2.0, 0.0, size),
        "saw": size * (3.0 * TIME % 1.0),
        "beat": size * np.sin(2.0 * np.pi * 50.0 * TIME) * np.exp(-((8.0 * (TIME - 5.0)) ** 2)),
    }
    for motion in motions.values():
        for seed in range(10):
            (kept,), words = without_lone_readings([trial_of(quiet(seed) + NOISE * motion)])
            assert words == []
    row, command = quiet(3), np.where(TIME < 5.0, 1.0, 2.0)
    row[np.argmax(TIME >= 5.0) + 1] += size * NOISE
    assert without_lone_readings([trial_of(row, command)])[1] == []


def test_a_slip_that_a_controller_answers_stands_alone_in_noise_with_heavy_tails():
    """The command jumps in the row of a slip and back in the next: that moves no slide at once."""
    generator = np.random.default_rng(5)
    rows = generator.choice(np.arange(5, 1495, 9), 12, replace=False)
    heavy = NOISE * generator.standard_t(4.0, TIME.size) / np.sqrt(2.0)
    row = 0.02 + 0.01 * np.sin(TIME) + heavy
    row[rows] += 25.0 * NOISE * np.array([1.0, -1.0] * 6)
    command = 2.0 + 0.1 * np.sin(TIME)
    command[rows] -= 100.0 * (row[rows] - 0.02)
    (kept,), (words,) = without_lone_readings([trial_of(row, command)])
    taken = set(np.flatnonzero(np.isnan(kept.measurements["contraction"])))
    assert len(taken & set(rows)) >= 11, words
    assert len(taken - set(rows)) <= 4


def test_steps_of_a_coarse_sensor_are_no_outliers():
    row = 3e-4 * np.round(quiet(2) / 3e-4)
    assert without_lone_readings([trial_of(row)])[1] == []
