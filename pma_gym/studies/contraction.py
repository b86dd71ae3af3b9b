"""Contraction and relaxation: spring constant and damping by pressure (sections 5.1.2-5.1.4).

Analysis of variance and estimates of a line, in the order in which the tables print them.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

from pma_gym.data.serres2008 import Table, load_table
from pma_gym.metrics import Regression, regression
from pma_gym.studies.comparison import (
    Comparison,
    compare,
    compare_computed,
    half_units,
    rounding_reach,
)

Figures = Callable[[Regression], dict[tuple[str, str], float]]

_TERMS = ("intercept", "slope")


def anova_figures(line: Regression) -> dict[tuple[str, str], float]:
    """Figures of an analysis of variance by source and column, as the tables name them."""
    dof = line.error_dof
    return {
        ("model", "df"): 1.0,
        ("model", "sum_of_squares"): line.ss_model,
        ("model", "mean_square"): line.ss_model,
        ("model", "f_ratio"): line.f_ratio,
        ("model", "p_value"): float(f_distribution.sf(line.f_ratio, 1, dof)),
        ("error", "df"): float(dof),
        ("error", "sum_of_squares"): line.ss_error,
        ("error", "mean_square"): line.residual_mean_square,
        ("total", "df"): float(dof + 1),
        ("total", "sum_of_squares"): line.ss_total,
    }


def estimate_figures(line: Regression) -> dict[tuple[str, str], float]:
    """Estimates of a line by term and column, as the tables name them."""
    estimates = (line.intercept, line.slope)
    errors = (line.intercept_std_error, line.slope_std_error)
    ratios = (line.intercept_t_ratio, line.slope_t_ratio)
    figures: dict[tuple[str, str], float] = {}
    for term, estimate, error, ratio in zip(_TERMS, estimates, errors, ratios, strict=True):
        figures[term, "estimate"] = estimate
        figures[term, "std_error"] = error
        figures[term, "t_ratio"] = ratio
        figures[term, "p_value"] = 2.0 * float(t_distribution.sf(abs(ratio), line.error_dof))
    return figures


def mean_figures(values: NDArray[np.float64]) -> dict[str, float]:
    """Mean, standard deviation, standard error and sum of squares, as tables 12 and 14 do."""
    deviation = float(np.std(values, ddof=1))
    return {
        "mean": float(np.mean(values)),
        "std_dev": deviation,
        "std_error": deviation / math.sqrt(values.size),
        "sse": deviation**2 * (values.size - 1),
    }


def compare_line(
    study: str,
    tables: tuple[str, str],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    y_printed: tuple[str, ...],
    note: str = "",
    estimates: bool = True,
) -> list[Comparison]:
    """A printed analysis of variance and its estimates beside the line through printed data.

    The pressures x are taken as exact: only with the printed integers do the tables come out.

    Args:
        study: name of the group.
        tables: analysis of variance, estimates.
        x: regressor, shape (n,).
        y: response, shape (n,).
        y_printed: response as printed, shape (n,).
        note: for every row.
        estimates: False where the estimates are not printed.
    """
    jobs: list[tuple[str, Figures, str]] = [(tables[0], anova_figures, "source")]
    if estimates:
        jobs.append((tables[1], estimate_figures, "term"))
    # Cells printed alike at one pressure are one figure, with one rounding error.
    alike = list(zip(x, y_printed, strict=True))
    distinct = sorted(set(alike))
    member = np.array([distinct.index(cell) for cell in alike])
    values = np.array([float(text) for _, text in distinct])
    halves = half_units([text for _, text in distinct])
    rows: list[Comparison] = []
    for name, figures, key in jobs:
        compute = _computation(figures, x, member)
        printed = load_table(name).printed
        cells = list(figures(regression(x, y)))
        texts = [printed[column][printed[key].index(row)] for row, column in cells]
        labels = [f"{row} {column}" for row, column in cells]
        reach = rounding_reach(compute, values, halves)
        rows += compare((study, name), labels, texts, compute(values), reach, note)
    return rows


def _computation(
    figures: Figures, x: NDArray[np.float64], member: NDArray[np.int_]
) -> Callable[[NDArray[np.float64]], list[float]]:
    """From the distinct values of y to the figures of the line through all of them."""
    return lambda values: list(figures(regression(x, values[member])).values())


def compare_mean(
    study: str, table: str, values: NDArray[np.float64], printed: tuple[str, ...]
) -> list[Comparison]:
    """Table 12 or 14 beside the mean of printed data.

    Args:
        study: name of the group.
        table: "12" or "14".
        values: shape (n,).
        printed: the values as printed, shape (n,).
    """

    def compute(sample: NDArray[np.float64]) -> list[float]:
        return list(mean_figures(sample).values())

    columns = load_table(table).printed
    names = list(mean_figures(values))
    texts = [columns[name][0] for name in names]
    reach = rounding_reach(compute, values, half_units(printed))
    return compare((study, table), names, texts, compute(values), reach)


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


CONTRACTION = "contraction"
RELAXATION = "relaxation"

SPRING_SPLIT_KPA = 314.0
"""Pressure at which the two lines of the spring constant meet (tables 7-10)."""

RELAXATION_SPLIT_KPA = 372.0
"""Pressure at which relaxation damping begins to rise (tables 13-16)."""


def _split(limit: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    low = load_table("I2")["pressure_kpa"] < limit
    return low, ~low


def secant_spring(table: Table) -> NDArray[np.float64]:
    """Spring constant (N/mm) as table I2 defines it: (F_ce - load) / contraction, shape (n,).

    Source:
        Serres 2008, Eq. 9c.
    """
    return (table["fce_n"] - table["load_n"]) / table["contraction_mm"]


def time_constants() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Time constants B / K (s) of table I2's steps, contracting and relaxing, shape (116,)."""
    table = load_table("I2")
    spring = table["spring_n_per_mm"]
    contracting = table["damping_contraction_ns_per_mm"] / spring
    return contracting, table["damping_relaxation_ns_per_mm"] / spring


def compare_contraction() -> list[Comparison]:
    """Tables 6 to 12 and I2's spring column beside what table I2 gives."""
    table = load_table("I2")
    pressure, spring = table["pressure_kpa"], table["spring_n_per_mm"]
    rows = _compare_constant_stiffness()
    halves = zip(_split(SPRING_SPLIT_KPA), (("7", "8"), ("9", "10")), strict=True)
    for part, tables in halves:
        texts = tuple(np.array(table.printed["spring_n_per_mm"])[part])
        rows += compare_line(CONTRACTION, tables, pressure[part], spring[part], texts)
    name = "damping_contraction_ns_per_mm"
    texts = table.printed[name]
    rows += compare_line(
        CONTRACTION, ("11", "12"), pressure, table[name], texts, "from table I2", estimates=False
    )
    return rows + compare_mean(CONTRACTION, "12", table[name], texts) + _compare_secants(table)


def compare_relaxation() -> list[Comparison]:
    """Tables 13 to 16 beside what table I2 gives, and Appendix D's exponent."""
    table = load_table("I2")
    name = "damping_relaxation_ns_per_mm"
    pressure, damping, printed = table["pressure_kpa"], table[name], np.array(table.printed[name])
    below, above = _split(RELAXATION_SPLIT_KPA)
    low, high = tuple(printed[below]), tuple(printed[above])
    rows = compare_line(
        *(RELAXATION, ("13", "14"), pressure[below], damping[below], low), estimates=False
    )
    rows += compare_mean(RELAXATION, "14", damping[below], low)
    rows += compare_line(RELAXATION, ("15", "16"), pressure[above], damping[above], high)
    return rows + _compare_appendix_d()


def compare_profiles() -> list[Comparison]:
    """Table 2, the model that the rest of the dissertation uses, beside tables 8 to 16."""
    table = load_table("2").printed
    low, high = (load_table(name).printed["estimate"] for name in ("8", "10"))
    printed = [*table["intercept"], *(slope for slope in table["slope_per_kpa"] if slope)]
    contracting, relaxing = (load_table(name).printed["mean"][0] for name in ("12", "14"))
    rising = load_table("16").printed["estimate"]
    sources = [low[0], high[0], contracting, relaxing, rising[0], low[1], high[1], rising[1]]
    columns = [(name, "intercept") for name in table["parameter"]]
    columns += [(table["parameter"][row], "slope") for row in (0, 1, 4)]
    names = [f"{name} {column}" for name, column in columns]
    return compare_computed(
        ("parameter profiles", "2"),
        names,
        printed,
        lambda values: values,
        sources,
        "from tables 8, 10, 12, 14 and 16",
    )


def _compare_constant_stiffness() -> list[Comparison]:
    printed = load_table("6").printed
    rows: list[Comparison] = []
    for row, pressure in enumerate(printed["pressure_kpa"]):
        rows += compare_computed(
            (CONTRACTION, "6"),
            [f"{pressure} kPa load in percent of F_ce"],
            [printed["percent_of_fce"][row]],
            lambda inputs: [100.0 * inputs[1] / (2.91 * inputs[0] + 44.6)],
            [pressure, printed["max_load_n"][row]],
            "load over 2.91 P + 44.6",
        )
    return rows


def _compare_secants(table: Table) -> list[Comparison]:
    """Count I2's spring constants that equal the secant of their row."""
    agree = np.abs(secant_spring(table) - table["spring_n_per_mm"]) <= 3e-5
    name = "spring constants that are the secant of their row"
    return compare(
        (CONTRACTION, "I2"),
        [name],
        [str(len(table))],
        [int(agree.sum())],
        note="(F_ce - load) / contraction, to 0.00003 N/mm",
    )


def _compare_appendix_d() -> list[Comparison]:
    """Appendix D fits exp(-K B t); Eq. 9b, from the equation of motion, has exp(-K t / B)."""
    table = load_table("I2")
    spring, damping = table["spring_n_per_mm"], table["damping_relaxation_ns_per_mm"]
    printed = f"{np.median(1.0 / (spring * damping)):.3f}"
    name = "median time constant of relaxation (s)"
    value = float(np.median(time_constants()[1]))
    return compare(
        (RELAXATION, "Appendix D"),
        [name],
        [printed],
        [value],
        note="1/(K B) by Appendix D, B/K by Eq. 9b",
    )
