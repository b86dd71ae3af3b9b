"""Files of the printed tables, and their rows as printed."""

import csv
import functools
from collections.abc import Iterable, Iterator
from importlib import resources

Row = dict[str, str]

_STATISTICS = ("tables_20_24_26_anova", "tables_20_24_26_anova_ratios")


def _files() -> Iterator[tuple[Iterable[str], tuple[str, ...], str]]:
    """Names of tables, the files that hold their columns, and what they show."""
    yield ["I1"], ("table_I1_static_loading",), "static loading"
    yield ["I2"], ("table_I2_contraction_relaxation",), "contraction and relaxation"
    yield ["I3"], ("table_I3_station_limits",), "limits of the station"
    profiles = [f"I{number}" for number in range(4, 21)]
    yield profiles, ("tables_I4_I20_voltage_profiles",), "voltage profile"
    yield ["2"], ("table_02_parameter_profiles",), "parameters by pressure"
    yield "4 7 9 11 13 15".split(), ("tables_04_15_anova",), "analysis of variance"
    yield "5 8 10 16".split(), ("tables_05_16_estimates",), "estimates"
    yield ["12", "14"], ("tables_12_14_means",), "mean damping"
    yield ["6"], ("table_06_constant_stiffness_limits",), "loads of constant stiffness"
    yield ["17"], ("table_17_station_limits_900n",), "limits at 900 N"
    yield ["18"], ("table_18_position_voltage",), "displacement by voltage"
    yield ["19"], ("table_19_recursion_coefficients",), "coefficients of the recursion"
    yield "20 24 25 26".split(), _STATISTICS, "analysis of variance of the trials"
    yield ["21"], ("table_21_displacement_regression",), "regression of the trials"
    yield "27 28 29".split(), ("tables_27_29_rotation_regression",), "regression of the trials"
    yield ["22"], ("table_22_displacement_rmse",), "errors of the trials"
    yield ["30"], ("table_30_rotation_rmse",), "errors of the trials"
    yield ["23"], ("table_23_required_moment",), "moment for 90 degrees"
    yield ["text"], ("text_statements",), "figures in the text"
    yield ["conversions"], ("text_conversions",), "conversions of units in the text"


FILES = {name: (files, title) for names, files, title in _files() for name in names}
"""Files (without .csv) and title of each table, by its name."""


@functools.cache
def _read(file: str) -> tuple[Row, ...]:
    text = (
        resources.files("pma_gym.data.serres2008")
        .joinpath(f"{file}.csv")
        .read_text(encoding="utf-8")
    )
    return tuple(csv.DictReader(text.splitlines()))


def _of_table(rows: Iterable[Row], name: str) -> Iterator[Row]:
    """The rows of one table, without the column that names it."""
    for row in rows:
        if row.get("table", name) == name:
            yield {column: text for column, text in row.items() if column != "table"}


def printed_rows(name: str) -> list[Row]:
    """The rows of a table with the figures as printed.

    Raises:
        KeyError: no such table; the message lists the tables.
    """
    if name not in FILES:
        raise KeyError(f"no table {name!r} of Serres 2008; there are {', '.join(FILES)}")
    parts = [_of_table(_read(file), name) for file in FILES[name][0]]
    return [
        {column: text for part in parts_of_row for column, text in part.items()}
        for parts_of_row in zip(*parts, strict=True)
    ]
