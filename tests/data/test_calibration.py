"""

Which readings are the station's DAQ's: by their levels, not by their column.

Outliers: single readings that stand alone are found and said; what a rig does is none.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pma_gym.data.calibration import (
    DAQ_LIMIT,
    DAQ_STEP,
    LOAD_CELL,
    LVDT,
    POTENTIOMETER,
    PRESSURE_TRANSDUCER,
    quantise,
)
from pma_gym.data.quality.clipping import at_daq_end, ends, read_by_daq
from pma_gym.data.quality.lone_readings import without_lone_readings
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.units import SI_FACTORS

# Table 1 as printed: volts = gain * value + offset, the value in the unit named.
TABLE_1 = {
    "mm": (LVDT, 0.0979, -0.881),
    "N": (LOAD_CELL, 0.0041, 0.0347),
    "bar": (PRESSURE_TRANSDUCER, 1.02, 0.027),
    "deg": (POTENTIOMETER, 0.0142, 0.087),
}


@pytest.mark.parametrize("unit", TABLE_1)
@given(value=st.floats(-1000, 1000))
def test_lines_are_those_of_table_1(unit, value):
    sensor, gain, offset = TABLE_1[unit]
    volts = sensor.to_volts(value * SI_FACTORS[unit])
    assert volts == pytest.approx(gain * value + offset, rel=1e-12, abs=1e-12)
    back = sensor.from_volts(volts) / SI_FACTORS[unit]
    assert back == pytest.approx(value, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("sensor", "unit", "step"),
    [
        (LVDT, "mm", 0.050),
        (LOAD_CELL, "N", 1.19),
        (PRESSURE_TRANSDUCER, "kPa", 0.48),
        (POTENTIOMETER, "deg", 0.344),
    ],
)
def test_one_step_of_the_daq(sensor, unit, step):
    assert DAQ_STEP == pytest.approx(4.88e-3, abs=5e-6)
    assert sensor.resolution / SI_FACTORS[unit] == pytest.approx(step, rel=0.01)


@given(st.floats(-9.99, 9.99))
def test_quantising_is_the_nearest_level_and_stays_there(volts):
    level = quantise(np.array([volts]))
    assert abs(level[0] - volts) <= DAQ_STEP / 2 * (1 + 1e-12)
    assert (level / DAQ_STEP == np.round(level / DAQ_STEP)).all()
    assert quantise(level) == level


def test_beyond_its_range_the_daq_holds_and_a_gap_stays_a_gap():
    assert quantise(np.array([12.0, -12.0])).tolist() == [10 - DAQ_STEP, -10.0]
    assert np.isnan(quantise(np.array([np.nan]))).all()


CONTRACTION = SIGNALS["contraction"]
SWAY = np.sin(np.linspace(0.0, 20.0, 400))


def stepped(values, step):
    return step * np.round(values / step)


def test_readings_of_the_daq_are_known_by_its_levels():
    volts = quantise(LVDT.to_volts(0.02 + 0.01 * SWAY))
    assert read_by_daq(CONTRACTION, LVDT.from_volts(volts))
    # A file that writes micrometres, and a trial with a gap.
    written = np.round(LVDT.from_volts(volts), 6)
    written[50:60] = np.nan
    assert read_by_daq(CONTRACTION, written)


@pytest.mark.parametrize("step", [50e-9, 1e-5, 1.3e-4, 3e-4])
def test_another_sensor_is_not_taken_for_the_daq(step):
    readings = stepped(0.02 + 0.01 * SWAY, step)
    assert not read_by_daq(CONTRACTION, readings)
    assert not at_daq_end(CONTRACTION, readings).any()


def test_a_stroke_beyond_the_lvdt_is_measured():
    """An axis of 1 m: no reading lies at an end of anything."""
    readings = stepped(0.5 * SWAY, 1e-5)
    assert not at_daq_end(CONTRACTION, readings).any()
    trial = Trial(np.arange(400) / 100.0, {"load_command": 10.0 * SWAY}, {"contraction": readings})
    assert ends([trial]) == []


def test_readings_at_an_end_of_the_daq_are_said():
    load = LOAD_CELL.from_volts(quantise(LOAD_CELL.to_volts(2600.0 * SWAY)))
    at = at_daq_end(SIGNALS["load"], load)
    volts = LOAD_CELL.to_volts(load)
    assert np.array_equal(at, np.abs(volts) > DAQ_LIMIT - 1.5 * DAQ_STEP)
    assert 0 < at.sum() < 200
    trial = Trial(np.arange(400) / 100.0, {"load_command": 10.0 * SWAY}, {"load": load})
    above, below = ends([trial])
    assert above.rows[0].sum() + below.rows[0].sum() == at.sum()
    assert above.words(["run.csv"], [trial]).startswith("load_n stands at the end of its sensor's")


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
