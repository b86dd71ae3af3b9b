"""Which readings are the station's DAQ's: by their levels, not by their column."""

import numpy as np
import pytest

from pma_gym.data.calibration import DAQ_LIMIT, DAQ_STEP, LOAD_CELL, LVDT, quantise
from pma_gym.data.quality.clipping import at_daq_end, ends, read_by_daq
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial

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
