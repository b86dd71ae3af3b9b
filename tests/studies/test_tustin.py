import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from pma_gym.studies.tustin import (
    appendix_c_recursion,
    cascade_transfer,
    closed_form_recursion,
    inverse_recursion,
    poles,
    tustin_recursion,
)
from pma_gym.studies.voltage_profile import MOTOR_RATE

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
