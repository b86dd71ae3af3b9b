import math

import numpy as np
import pytest

from pma_gym.data.serres2008 import corrections, load_table, pressures, table_names

ROWS = {"I1": 45, "I2": 116, "I3": 396, "18": 9, "19": 9, "22": 9, "30": 8}


I3 = load_table("I3")


def test_every_table_loads_and_has_the_rows_of_the_print():
    assert {name: len(load_table(name)) for name in ROWS} == ROWS
    profiles = [len(load_table(f"I{number}")) for number in range(4, 21)]
    assert profiles == [26] * 9 + [76] * 8
    assert sum(profiles) == 842
    assert all(len(load_table(name)) for name in table_names())


def test_the_trials_of_each_task():
    assert pressures("displacement") == (150, 200, 250, 300, 350, 400, 450, 500, 550)
    assert pressures("rotation") == (275, 300, 350, 400, 450, 500, 550, 575)


@pytest.mark.parametrize("name", table_names())
def test_every_change_of_a_cell_is_listed_and_nothing_else_changes(name):
    printed, corrected = load_table(name, corrected=False), load_table(name)
    changed = {(item.row, item.column): item for item in corrections(name)}
    for column in printed.columns:
        for row, (before, after) in enumerate(zip(printed[column], corrected[column], strict=True)):
            if (row, column) in changed:
                item = changed[row, column]
                assert printed.printed[column][row] == item.printed
                assert before == float(item.printed)
                assert after == item.corrected or math.isnan(item.corrected)
                assert item.reason
            elif printed[column].dtype.kind == "f":
                assert before == after or (math.isnan(before) and math.isnan(after))
            else:
                assert before == after


def test_table_i3_agrees_with_its_own_percent_columns_once_corrected():
    for percent, length in (
        ("extension_percent", "extension_mm"),
        ("return_percent", "return_mm"),
    ):
        ratio = 100 * I3[length] / I3["no_load_contraction_mm"]
        assert np.max(np.abs(I3[percent] - ratio)) < 0.0051


def test_the_known_misprints():
    row = I3.where(pressure_nominal_kpa=300, load_nominal_n=225)
    assert row["pressure_kpa"][0] == 310
    row = I3.where(pressure_nominal_kpa=550, load_nominal_n=825)
    assert row["return_mm"][2] == 35.9
    row = I3.where(pressure_nominal_kpa=250, load_nominal_n=75)
    assert list(row["pressure_kpa"]) == [256, 255, 255]
    row = I3.where(pressure_nominal_kpa=300, load_nominal_n=900)
    assert row["rotation_deg"][2] == 114


def test_a_figure_that_cannot_be_recovered_is_nan_and_only_there():
    rotation = I3["rotation_deg"]
    lost = np.flatnonzero(np.isnan(rotation))
    assert list(I3["pressure_nominal_kpa"][lost]) == [300, 300]
    assert list(I3["load_nominal_n"][lost]) == [450, 450]
    others = [c for c in I3.columns if c != "rotation_deg"]
    assert all(np.isfinite(I3[column]).all() for column in others)


def test_corrected_measurements_have_no_outlier_left():
    nominal = I3["pressure_nominal_kpa"]
    assert np.max(np.abs(I3["pressure_kpa"] - 1.016 * nominal - 3.4)) < 12
    difference = I3["extension_mm"] - I3["return_mm"]
    assert difference.mean() == pytest.approx(0.80, abs=0.01)
    assert difference.std() == pytest.approx(0.52, abs=0.01)


def test_corrected_tables_agree_with_each_other():
    for table in ("21", "27", "28", "29"):
        estimates = load_table(table)
        ratio = estimates["estimate"] / estimates["std_error"]
        assert ratio == pytest.approx(estimates["t_ratio"], rel=1e-3)
    for table in ("20", "24", "25", "26"):
        anova = load_table(table)
        # Two mean squares of table 24 are printed as whole numbers.
        assert anova["ss_error"] / 1921 == pytest.approx(anova["ms_error"], rel=0.03)
        assert 1921 * anova["ss_model"] / anova["ss_error"] == pytest.approx(
            anova["f_ratio"], rel=1e-4
        )


def test_arrays_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        load_table("I1")["load_n"][0] = 0.0
    assert load_table("I1")["load_n"][0] == 184


def test_errors_say_what_there_is():
    for message, act in (
        ("no table 'I21'.*I1, I2, I3", lambda: load_table("I21")),
        ("no column 'load'.*load_n, pressure_kpa", lambda: load_table("I1")["load"]),
        ("no task 'pull'.*displacement, rotation", lambda: pressures("pull")),
    ):
        with pytest.raises(KeyError, match=message):
            act()
