""""""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import linregress

from pma_gym.metrics import (
    PHASE_SAMPLES,
    SAMPLE_RATE_HZ,
    Regression,
    percent_of_range,
    phase_times,
    regression,
    rmse,
    rmse_from_regression,
)
from pma_gym.units import SI_FACTORS, Quantity, suffix

# Slope, its standard error and t ratio, intercept, its standard error and t ratio (tables 21 and
# 27-29), sums of squares of model and error and F ratio (tables 20, 24-26), RMSE (tables 22, 30).
PRINTED = {
    "displacement 200 kPa": (
        (5.2881501, 0.014405, 367.11, -0.411187, 0.0416, -9.88),
        (112383.0, 1601.93, 134767.0),
        1.05,
    ),
    "displacement 550 kPa": (
        (4.7451346, 0.007819, 606.86, 0.9449004, 0.022581, 41.85),
        (90487.8, 471.991, 368285.0),
        0.69,
    ),
    "I 300 kPa": (
        (19.346717, 0.045365, 426.46, -6.567495, 0.13101, -50.13),
        (1504207.2, 15888.0, 181871.6),
        4.72,
    ),
    "II 450 kPa": (
        (0.138806, 0.033806, 4.11, 88.823421, 0.097628, 909.81),
        (77.4301, 8822.9757, 16.8586),
        2.31,
    ),
    "III 500 kPa": (
        (-19.59139, 0.033645, -582.3, 95.551026, 0.097162, 983.42),
        (1542494.5, 8738.8, 339075.9),
        3.51,
    ),
}
IDEAL = {"displacement": (5.0, 0.0), "I": (18.0, 0.0), "II": (0.0, 90.0), "III": (-18.0, 90.0)}

finite = st.floats(-1e3, 1e3, allow_subnormal=False)


def test_the_grid_is_1923_samples_at_384_hz():
    times = phase_times(2)
    assert times.shape == (PHASE_SAMPLES,) == (1923,)
    assert times[0] == 10.0
    assert_allclose(np.diff(times), 1 / SAMPLE_RATE_HZ, rtol=1e-9)
    assert_allclose(times[-1], 10 + 1922 / 384)


def test_rmse_of_a_known_error():
    assert rmse([3.0, -4.0]) == math.sqrt(12.5)


def test_percent_of_range_is_what_table_22_prints():
    assert percent_of_range(1.92, 25) == pytest.approx(7.68)
    assert percent_of_range(8.25, 90) == pytest.approx(9.17, abs=0.005)


@pytest.mark.parametrize("trial", PRINTED)
def test_the_tables_follow_from_slope_intercept_and_error(trial):
    (slope, *slope_row, intercept, intercept_error, intercept_t), anova, printed = PRINTED[trial]
    ss_model, ss_error, f_ratio = anova
    times = phase_times()
    spread = float(np.sum(np.square(times - times.mean())))
    line = Regression(times.size, slope, intercept, ss_error, float(times.mean()), spread)
    assert line.error_dof == 1921
    assert_allclose([line.slope_std_error, line.slope_t_ratio], slope_row, rtol=2e-3)
    # The printed intercepts belong to times that begin one sample earlier: 1e-3 of the error.
    assert_allclose(line.intercept_std_error, intercept_error, rtol=2e-3)
    assert_allclose(line.intercept_t_ratio, intercept_t, rtol=2e-3)
    assert_allclose(line.ss_model, ss_model, rtol=1e-5)
    assert_allclose(line.f_ratio, f_ratio, rtol=3e-5)
    assert rmse_from_regression(line, *IDEAL[trial.split()[0]]) == pytest.approx(printed, abs=0.006)


def test_times_of_the_tables_have_the_rate_of_the_grid():
    (slope, slope_error, _, _, intercept_error, _), (_, ss_error, _), _ = PRINTED["I 300 kPa"]
    mean_square = ss_error / 1921
    times = phase_times()
    assert_allclose(mean_square / slope_error**2, np.sum((times - times.mean()) ** 2), rtol=1e-4)
    # Their mean time is 2.5000 s, one sample before that of 0, 1/384, ... s.
    spread = PRINTED["I 300 kPa"][1][0] / slope**2
    mean_time = math.sqrt((intercept_error**2 / mean_square - 1 / 1923) * spread)
    assert mean_time == pytest.approx(times.mean() - 1 / 384, abs=1e-4)


@given(st.lists(finite, min_size=3, max_size=40))
@example([0.0, 0.0, 1.6e-161])
def test_regression_agrees_with_scipy(values):
    time = np.arange(len(values)) / 7
    line = regression(time, values)
    # Its correlation, which is not compared, divides by squares that may be too small for a number.
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = linregress(time, values)
    scale = 1 + np.abs(values).max()
    assert_allclose(line.slope, expected.slope, rtol=1e-9, atol=1e-9 * scale)
    assert_allclose(line.intercept, expected.intercept, rtol=1e-9, atol=1e-9 * scale)
    assert_allclose(line.ss_total, np.sum((values - np.mean(values)) ** 2), atol=1e-9 * scale**2)


def test_standard_errors_and_r_squared_agree_with_scipy():
    time = phase_times()
    values = 5 * time - 1 + np.random.default_rng(1).normal(size=time.size)
    line, expected = regression(time, values), linregress(time, values)
    assert_allclose(line.slope_std_error, expected.stderr)
    assert_allclose(line.intercept_std_error, expected.intercept_stderr)
    assert_allclose(line.r_squared, expected.rvalue**2)
    assert_allclose(line.f_ratio, line.slope_t_ratio**2)


@given(st.lists(finite, min_size=3, max_size=40), finite, finite)
def test_rmse_from_regression_is_the_rmse(values, slope, intercept):
    time = np.arange(len(values)) / 5
    error = np.array(values) - (intercept + slope * time)
    identity = rmse_from_regression(regression(time, values), slope, intercept)
    assert_allclose(identity, rmse(error), rtol=1e-7, atol=1e-9)


def test_a_perfect_line_has_infinite_ratios_and_a_constant_no_r_squared():
    line = regression([0.0, 1.0, 2.0], [0.0, 2.0, 4.0])
    assert line.ss_error == 0 and line.f_ratio == math.inf and line.slope_t_ratio == math.inf
    assert math.isnan(regression([0.0, 1.0, 2.0], [0.0, 0.0, 0.0]).r_squared)


@pytest.mark.parametrize(
    ("time", "values", "message"),
    [
        ([], [], "time has no samples"),
        ([0, 1], [0, 1], "at least 3 samples, got 2"),
        ([0, 1, 2], [0, 1], r"equally long, got shapes \(3,\) and \(2,\)"),
        ([0, 1, 2], [0, math.nan, 1], "values must be finite, sample 1 is nan"),
        ([4, 4, 4], [0, 1, 2], "different times, all are 4 s"),
    ],
)
def test_regression_refuses(time, values, message):
    with pytest.raises(ValueError, match=message):
        regression(time, values)


def test_rmse_refuses_what_was_not_measured():
    with pytest.raises(ValueError, match="error must be finite, sample 2 is nan; leave out"):
        rmse([0.0, 1.0, math.nan])


@pytest.mark.parametrize(
    ("unit", "value", "expected"),
    [
        ("mm", 25.0, 0.025),
        ("kPa", 600.0, 6e5),
        ("bar", 6.0, 6e5),
        ("deg", 180.0, math.pi),
        ("deg/s", 18.0, math.pi / 10),
        ("N/mm", 32.7, 32700.0),
        ("N s/mm", 2.9, 2900.0),
        ("N/kPa", 2.91, 2.91e-3),
        ("N/mm/kPa", -0.0321, -0.0321),
        ("1/mm", 1.0, 1000.0),
        ("V/bar", 1.02, 1.02e-5),
        ("%", 4.0, 0.04),
        ("1", 3.0, 3.0),
    ],
)
def test_units_become_si(unit, value, expected):
    quantity = Quantity(unit, -1e9, 1e9, "test")
    assert quantity.to_si(value) == pytest.approx(expected, rel=1e-15)
    assert quantity.from_si(expected) == pytest.approx(value, rel=1e-15)


QUANTITIES = [Quantity(unit, -1e6, 1e6, "test") for unit in SI_FACTORS]


@given(value=st.floats(-1e6, 1e6))
def test_there_and_back_is_the_same(value):
    for quantity in QUANTITIES:
        back = quantity.from_si(quantity.to_si(value))
        assert back == pytest.approx(value, rel=1e-15, abs=1e-300)


def test_suffixes_are_names_and_differ():
    suffixes = [suffix(unit) for unit in SI_FACTORS]
    assert len(set(suffixes)) == len(suffixes)
    assert all(f"x_{ending}".isidentifier() and ending == ending.lower() for ending in suffixes)


def test_a_name_carries_its_unit():
    assert Quantity("N/mm", 0, 1, "test").name("stiffness") == "stiffness_n_per_mm"
    assert Quantity("1", 0, 1, "test").name("share") == "share"


def test_bounds_belong_to_the_range():
    quantity = Quantity("kPa", 150, 575, "test")
    quantity.check("pressure_kpa", 150)
    quantity.check("pressure_kpa", 575)


@pytest.mark.parametrize("value", [149.9, 576.0, math.nan])
def test_a_value_out_of_range_is_refused(value):
    message = f"pressure_kpa must lie in 150 to 575 kPa, got {value!r}; "
    with pytest.raises(ValueError, match=message + r"check unit and .* \(usual: test\)"):
        Quantity("kPa", 150, 575, "test").check("pressure_kpa", value)
    with pytest.raises(ValueError, match=message + r"leave it out \(usual: test\)"):
        Quantity("kPa", 150, 575, "test", instead="leave it out").check("pressure_kpa", value)


def test_a_quantity_refuses_an_unknown_unit_and_reversed_bounds():
    for message, act in (
        ("unknown unit 'psi'; write one of 1, %, V, ", lambda: Quantity("psi", 0, 1, "test")),
        ("bounds 2 to 1 kPa are reversed", lambda: Quantity("kPa", 2, 1, "test")),
        ("usual must lie in 0 to 1 kPa, got 2", lambda: Quantity("kPa", 0, 1, "test", usual=2)),
    ):
        with pytest.raises(ValueError, match=message):
            act()
