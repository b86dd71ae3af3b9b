import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pma_gym.data.calibration import (
    DAQ_STEP,
    LOAD_CELL,
    LVDT,
    POTENTIOMETER,
    PRESSURE_TRANSDUCER,
    quantise,
)
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


def test_arrays_go_through_like_floats():
    volts = np.array([[0.0, 1.0], [-2.5, np.nan]])
    assert_allclose(LVDT.from_volts(volts)[1, 0], LVDT.from_volts(-2.5))
    assert np.isnan(LVDT.from_volts(volts)[1, 1])


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
