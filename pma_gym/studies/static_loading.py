"""Static loading: the muscle's force at its resting length (section 5.1.1)."""

import numpy as np

from pma_gym.data.serres2008 import load_table
from pma_gym.metrics import Regression, regression
from pma_gym.studies.comparison import Comparison, compare, compare_computed
from pma_gym.studies.line_analysis import compare_line

STUDY = "static loading"


def contractile_force_line() -> Regression:
    """Load on pressure (N by kPa) over the 45 measurements of table I1.

    Source:
        Serres 2008, section 5.1.1: F_ce = 2.91 P + 44.6.

    >>> line = contractile_force_line()
    >>> round(line.slope, 2), round(line.intercept, 1)
    (2.91, 44.6)
    """
    table = load_table("I1")
    return regression(table["pressure_kpa"], table["load_n"])


def compare_static_loading() -> list[Comparison]:
    """Tables 4 and 5 beside table I1, and beside the column of table I2 that they really analyse.

    Table 4 has 114 degrees of freedom; table I1 has 45 rows. The 116 contractile forces of table
    I2 are themselves values of the line, so their analysis measures nothing but their rounding.
    """
    measured, stepped = load_table("I1"), load_table("I2")
    line = contractile_force_line()
    text = load_table("text").where(section="5.1.1").printed
    rows = compare((STUDY, "text"), text["quantity"], text["printed"], [line.slope, line.intercept])
    loads, x = measured.printed["load_n"], measured["pressure_kpa"]
    rows += compare_line(
        *(STUDY, ("4", "5"), x, measured["load_n"], loads), "from the 45 measurements of table I1"
    )
    forces, x = stepped.printed["fce_n"], stepped["pressure_kpa"]
    again = compare_line(
        *(STUDY, ("4", "5"), x, stepped["fce_n"], forces),
        "from table I2's F_ce, which is the line itself: the error is rounding",
    )
    # The F ratio of a perfect line is one over rounding: only the printed squares can check it.
    rows += [row for row in again if row.quantity != "model f_ratio"]
    return rows + _compare_f_ratio()


def _compare_f_ratio() -> list[Comparison]:
    printed = load_table("4").printed
    return compare_computed(
        (STUDY, "4"),
        ["model f_ratio"],
        [printed["f_ratio"][0]],
        lambda squares: [squares[0] / squares[1]],
        printed["mean_square"][:2],
        "from the printed mean squares",
    )


def rounding_of_table_i2() -> float:
    """Largest distance (N) of table I2's contractile force from the line of table I1."""
    line, table = contractile_force_line(), load_table("I2")
    force = line.intercept + line.slope * table["pressure_kpa"]
    return float(np.max(np.abs(table["fce_n"] - force)))
