""""""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.studies.recursion import PROFILES, agreeing_rows
from pma_gym.studies.tustin import (
    appendix_c_recursion,
    cascade_transfer,
    closed_form_recursion,
    inverse_recursion,
    poles,
    tustin_recursion,
)
from pma_gym.studies.voltage_profile import (
    MOTOR_RATE,
    feedforward,
    profile_model,
    reachable_mm,
    used_quadratics,
    voltage_from_input,
    voltage_profile,
)

TABLE_18 = used_quadratics()


@pytest.mark.parametrize("table", PROFILES)
def test_every_row_of_the_printed_profiles_is_reproduced(table):
    assert agreeing_rows(table).all()


@pytest.mark.parametrize("table", PROFILES)
def test_the_wanted_positions_are_the_printed_ones(table):
    printed = load_table(table)
    profile = voltage_profile(str(printed["task"][0]), float(printed["pressure_kpa"][0]))
    assert profile.time == pytest.approx(printed["time_s"])
    assert profile.reference == pytest.approx(printed["y_desired_m"], abs=1e-12)


@pytest.mark.parametrize("pressure", TABLE_18)
def test_the_voltage_maps_back_to_its_displacement(pressure):
    quadratic = TABLE_18[pressure]
    wanted = np.linspace(max(1e-4, quadratic.constant), quadratic.reach, 50)
    voltage = voltage_from_input(wanted, quadratic)
    assert quadratic.displacement(voltage) == pytest.approx(wanted)
    assert np.all(np.diff(voltage) > 0)
    assert voltage[0] >= 0
    assert voltage[-1] <= 10


def test_table_18_has_a_dead_zone_from_250_kpa_on_and_ends_at_27_mm_at_150_kpa():
    for pressure, quadratic in TABLE_18.items():
        if pressure >= 250:
            assert 0.38 < voltage_from_input([1e-9], quadratic)[0] < 0.50
    assert reachable_mm(150) == pytest.approx(27.2, abs=0.05)


@pytest.mark.parametrize("pressure", pressures("rotation"))
def test_the_hold_chatters_by_more_than_half_a_volt(pressure):
    hold = voltage_profile("rotation", pressure).voltage[25:51]
    steps = np.diff(hold)
    assert np.all(steps[1:] * steps[:-1] < 0)
    assert np.all((np.abs(steps) > 0.58) & (np.abs(steps) < 0.98))


@given(st.floats(150, 575), st.sampled_from([0.05, 0.1, 0.25]))
def test_a_profile_exists_at_other_sample_times(pressure, period):
    time = np.arange(0, 5, period)
    voltage = feedforward(0.004 * time, pressure, period).voltage
    assert np.all((voltage >= 0) & (voltage <= 10))


def test_the_model_is_linear_between_the_pressures():
    low, middle, high = (profile_model(pressure) for pressure in (300, 325, 350))
    assert middle.muscle_rate == pytest.approx((low.muscle_rate + high.muscle_rate) / 2)
    mean = (np.array(low.quadratic) + np.array(high.quadratic)) / 2
    assert middle.quadratic == pytest.approx(mean)


def test_beyond_the_map_the_error_names_what_can_be_reached():
    for error, message, act in (
        (
            ValueError,
            r"150 kPa: displacement must lie in 0-27\.2\d mm",
            lambda: feedforward(np.linspace(0, 0.04, 26), 150),
        ),
        (
            ValueError,
            "reference itself needs only 24.99 mm.*longer sample_time",
            lambda: feedforward(np.arange(0, 0.025, 1e-5), 150, 0.002),
        ),
        (ValueError, "150-575 kPa.*got 600", lambda: feedforward([0.0], 600)),
        (ValueError, "150-575 kPa.*got nan", lambda: profile_model(float("nan"))),
        (
            ValueError,
            "displacement must lie in",
            lambda: voltage_from_input([np.nan], TABLE_18[300]),
        ),
        (KeyError, "displacement, rotation", lambda: voltage_profile("pull", 300)),
    ):
        with pytest.raises(error, match=message):
            act()


rates = st.floats(1.0, 100.0)
periods = st.floats(1e-3, 0.5)


def followed(x_input, recursion):
    """The position that an input leads to, everything zero before the first sample."""
    a, b, c, d, e = recursion
    return lfilter([e, d, c], [1.0, b, a], x_input)


@given(rates, st.floats(100.0, 2e4), periods, st.floats(0.1, 10.0))
def test_python_controls_tustin_is_eq_25(muscle, motor, period, gain):
    sampled = tustin_recursion(cascade_transfer(muscle, motor, gain), period)
    closed = closed_form_recursion(muscle, motor, period, gain)
    assert sampled == pytest.approx(closed, rel=1e-9, abs=1e-12)


@given(rates, periods)
def test_eq_25_is_stable_and_appendix_c_is_not(muscle, period):
    assert np.all(np.abs(poles(closed_form_recursion(muscle, MOTOR_RATE, period))) < 1)
    assert np.all(np.abs(poles(appendix_c_recursion(muscle, MOTOR_RATE, period))) > 1)


@given(rates, periods)
def test_the_recursion_has_the_gain_of_the_cascade_at_rest(muscle, period):
    a, b, c, d, e = closed_form_recursion(muscle, MOTOR_RATE, period)
    assert (c + d + e) / (1 + a + b) == pytest.approx(1.0)


@given(st.lists(st.floats(-0.05, 0.05), min_size=3, max_size=80))
def test_the_inverse_undoes_the_recursion(reference):
    recursion = closed_form_recursion(12.0, MOTOR_RATE, 0.2)
    x_input = inverse_recursion(reference, recursion)
    assert followed(x_input, recursion) == pytest.approx(reference, abs=1e-9)


def test_the_inverse_of_a_step_alternates_for_ever():
    recursion = closed_form_recursion(12.0, MOTOR_RATE, 0.2)
    steps = np.diff(inverse_recursion(np.full(200, 0.01), recursion))
    assert np.all(steps[1:] * steps[:-1] < 0)
    assert np.min(np.abs(steps)) > 0.001


def test_the_oscillation_of_the_inverse_of_a_ramp_grows_as_stated():
    muscle, period, speed = 12.0, 0.01, 0.005
    recursion = closed_form_recursion(muscle, MOTOR_RATE, period)
    x_input = inverse_recursion(speed * period * np.arange(501), recursion)
    # Second differences of an alternation of amplitude a are 4 a.
    amplitude = np.abs(np.diff(x_input, 2)) / 4
    growth = 4 * speed / (muscle * MOTOR_RATE * period)
    assert np.diff(amplitude)[100:] == pytest.approx(growth, rel=0.01)


def test_the_recursion_follows_the_muscle_in_continuous_time():
    muscle, period = 10.0, 1e-3
    time = np.arange(1, 500) * period
    recursion = closed_form_recursion(muscle, MOTOR_RATE, period)
    response = followed(np.ones(500), recursion)[1:]
    assert response == pytest.approx(1 - np.exp(-muscle * time), abs=0.006)
