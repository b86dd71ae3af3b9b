""""""

import numpy as np
import pytest

from pma_gym.data.serres2008 import corrections, load_table
from pma_gym.metrics import rmse_from_regression
from pma_gym.studies import compare_all
from pma_gym.studies.comparison import compare_computed, half_unit, rounding_reach, verdict
from pma_gym.studies.contraction import (
    contractile_force_line,
    time_constants,
)
from pma_gym.studies.recursion import table_19_recursion
from pma_gym.studies.trials import TRIALS, measured_regression


@pytest.fixture(scope="module")
def rows():
    return compare_all()


def wrong(rows, table, note=""):
    return {r.quantity for r in rows if r.table == table and r.verdict == "wrong in print"}


def test_force_at_the_resting_length():
    line = contractile_force_line()
    assert line.slope == pytest.approx(2.91, abs=0.005)
    assert line.intercept == pytest.approx(44.6, abs=0.05)


def test_time_constants_of_the_muscle_are_those_of_the_regulator():
    contracting, relaxing = time_constants()
    assert np.median(contracting) == pytest.approx(0.116, abs=0.001)
    assert np.median(relaxing) == pytest.approx(0.067, abs=0.001)


def test_tables_7_to_16_follow_from_table_i2(rows):
    for table in "7 8 9 10 11 12 13 14 15 16 2".split():
        assert not wrong(rows, table)


def test_table_4_analyses_a_line_and_not_the_loading_study(rows):
    table_4 = [row for row in rows if row.table in ("4", "5")]
    from_i1 = {row.quantity: row.verdict for row in table_4 if "I1" in row.note}
    assert from_i1["slope estimate"] == from_i1["intercept estimate"] == "equal"
    assert from_i1["error df"] == "wrong in print"
    assert not wrong([row for row in table_4 if "I1" not in row.note], "4")


def test_table_17_is_the_mean_of_table_i3_but_for_one_figure(rows):
    assert wrong(rows, "17") == {"200 kPa extension_mm"}


def test_table_18_is_the_fit_of_table_i3_but_for_one_figure(rows):
    fits = [row for row in rows if row.table == "18" and row.study == "station limits"]
    assert len(fits) == 9 * 4
    assert wrong(fits, "18") == {"450 kPa v1_m_per_v"}


def test_table_19_is_eq_25_sampled_at_7_8_ms(rows):
    table = load_table("19")
    assert np.allclose(table["d"], 2 * table["c"], atol=1.1e-4)
    coefficients = [r for r in rows if r.table == "19" and "spring" not in r.quantity]
    assert len(coefficients) == 45
    assert {row.verdict for row in coefficients} == {"equal"}
    assert min(np.roots([1, *reversed(table_19_recursion(400)[:2])])) == pytest.approx(
        -0.9625, abs=1e-4
    )


def test_table_19_is_what_the_profiles_use_up_to_250_kpa_only(rows):
    springs = [row for row in rows if row.table == "19" and "spring" in row.quantity]
    wrong_ones = [row.quantity for row in springs if row.verdict == "wrong in print"]
    assert [text[:3] for text in wrong_ones] == ["300", "350", "400", "450", "500", "550"]


def test_appendix_c_is_unstable_and_eq_25_is_not(rows):
    poles = {row.table: float(row.printed) for row in rows if "magnitude" in row.quantity}
    assert poles["Eq. 25"] < 1 < poles["Appendix C"]
    assert not wrong(rows, "Eq. 25")


def test_the_tables_of_the_trials_agree_but_for_these_figures(rows):
    expected = {
        "20": {"500 kPa ms_error"},
        "21": {"150 kPa slope t_ratio"},
        "22": set(),
        "24": set(),
        "25": set(),
        "26": {"400 kPa ms_error"},
        "27": {"275 kPa intercept std_error", "275 kPa slope t_ratio"},
        "28": {"350 kPa slope std_error", "550 kPa slope std_error"},
        "29": {"350 kPa intercept t_ratio", "575 kPa slope t_ratio"},
        "30": {"350 kPa phase_iii_deg"},
    }
    assert {table: wrong(rows, table) for table in expected} == expected


def test_each_trial_is_known_by_its_regression():
    for trial in TRIALS:
        table, column, _ = trial.errors
        errors = load_table(table)
        for pressure, printed in zip(errors["pressure_kpa"], errors[column], strict=True):
            line = measured_regression(trial.phase, pressure)
            assert rmse_from_regression(line, *trial.ideal) == pytest.approx(printed, abs=0.012)


def test_the_hold_creeps():
    slopes = load_table("28").where(term="slope")["estimate"]
    assert np.all((slopes > 0.13) & (slopes < 0.34))


def test_corrected_cells_of_the_result_tables_are_wrong_in_print(rows):
    for item in corrections():
        if item.table in ("17", "18", "21", "26", "27", "28", "29"):
            figures = {r.printed for r in rows if r.table == item.table and "wrong" in r.verdict}
            assert item.printed in figures


def test_900_n_are_not_246_lb(rows):
    assert "900 N in lb" in wrong(rows, "section 4.2.2")


@pytest.mark.parametrize(
    ("printed", "half"),
    [("17.5", 0.05), ("146", 0.5), ("-0.0005", 5e-5), ("110.0", 0.5), ("9.25e-05", 5e-8)],
)
def test_half_a_unit_of_the_last_printed_digit(printed, half):
    assert half_unit(printed) == pytest.approx(half)


def test_verdicts():
    assert verdict("2.91", 2.9121) == "equal"
    assert verdict("2.91", 2.916) == "wrong in print"
    assert verdict("2.91", 2.916, reach=0.002) == "rounded"
    assert verdict("0.125", 0.1255) == "equal"
    assert verdict("<0.0001", 1e-9) == "equal"
    assert verdict("<0.0001", 0.01) == "wrong in print"


def test_one_input_moves_its_figure_by_its_own_half_unit():
    assert rounding_reach(lambda v: [3 * v[0]], [2.0], [0.5]) == pytest.approx([1.5])
    assert rounding_reach(lambda v: [3 * v[0]], [2.0], [0.0]) == pytest.approx([0.0])


def test_many_independent_inputs_reach_three_standard_deviations():
    reach = rounding_reach(lambda v: [v.sum()], np.zeros(100), np.full(100, 0.5))
    assert reach == pytest.approx([3 * 10 * 0.5 / np.sqrt(3)])


def test_a_quotient_of_rounded_figures_is_rounded_not_wrong():
    def ratio(v):
        return [v[0] / v[1]]

    (row,) = compare_computed(("s", "t"), ["q"], ["0.68"], ratio, ["2.0", "3.0"])
    assert row.verdict == "rounded"
