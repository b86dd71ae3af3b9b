import numpy as np
import pytest

from pma_gym.studies.comparison import compare_computed, half_unit, rounding_reach, verdict


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
