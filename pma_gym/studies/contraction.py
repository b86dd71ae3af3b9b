"""Contraction and relaxation: spring constant and damping by pressure (sections 5.1.2-5.1.4)."""

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.serres2008 import Table, load_table
from pma_gym.metrics import Regression, regression
from pma_gym.studies.comparison import Comparison, compare, compare_computed
from pma_gym.studies.line_analysis import compare_line, compare_mean

CONTRACTION = "contraction"
RELAXATION = "relaxation"

SPRING_SPLIT_KPA = 314.0
"""Pressure at which the two lines of the spring constant meet (tables 7-10)."""

RELAXATION_SPLIT_KPA = 372.0
"""Pressure at which relaxation damping begins to rise (tables 13-16)."""


def _split(limit: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    low = load_table("I2")["pressure_kpa"] < limit
    return low, ~low


def spring_lines() -> tuple[Regression, Regression]:
    """Spring constant on pressure (N/mm by kPa), below and above 314 kPa, from table I2.

    Source:
        Serres 2008, tables 7-10.
    """
    table = load_table("I2")
    below, above = _split(SPRING_SPLIT_KPA)
    pressure, spring = table["pressure_kpa"], table["spring_n_per_mm"]
    return regression(pressure[below], spring[below]), regression(pressure[above], spring[above])


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
    note = "from tables 8, 10, 12, 14 and 16"
    return compare_computed(
        ("parameter profiles", "2"), names, printed, lambda values: values, sources, note
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
    note = "(F_ce - load) / contraction, to 0.00003 N/mm"
    name = "spring constants that are the secant of their row"
    return compare((CONTRACTION, "I2"), [name], [str(len(table))], [int(agree.sum())], note=note)


def _compare_appendix_d() -> list[Comparison]:
    """Appendix D fits exp(-K B t); Eq. 9b, from the equation of motion, has exp(-K t / B)."""
    table = load_table("I2")
    spring, damping = table["spring_n_per_mm"], table["damping_relaxation_ns_per_mm"]
    printed = f"{np.median(1.0 / (spring * damping)):.3f}"
    note = "1/(K B) by Appendix D, B/K by Eq. 9b"
    name = "median time constant of relaxation (s)"
    value = float(np.median(time_constants()[1]))
    return compare((RELAXATION, "Appendix D"), [name], [printed], [value], note=note)
