"""A pure number has no unit in any message or table: 'hold it to 0.3', not '0.3 1'.

Effects in a sentence: which of them may be another one is clear.
"""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pma_gym.discovery.fitting.free_parameters import FreeParameters, unit
from pma_gym.discovery.report.figure_text import estimate_text
from pma_gym.discovery.report.size_text import effect_sizes, sized_effects
from pma_gym.discovery.report.summary import print_fit
from pma_gym.discovery.report.tables import effect_table, moved_table
from pma_gym.discovery.report.verdict_text import sentence, unidentified
from pma_gym.discovery.result.estimates import Estimate, Moved, NamedEffect
from pma_gym.units import Quantity

PURE, FORCE = "filling.exponent", "drive.offset_n"
KNOWN = Estimate(1.25, 1.05, 1.45, "1")


def hardly_held(path):
    """Why a parameter is not determined that trials hold to 0.3, and 0.4 was assumed."""
    fit = SimpleNamespace(paths=(path,), covariance=np.array([[0.09]]))
    return unidentified(path, fit, FreeParameters((path,), np.array([0.4])))


def refused(quantity, value):
    """What a value out of bounds is told."""
    with pytest.raises(ValueError, match="must lie in") as error:
        quantity.check("exponent", value)
    return str(error.value)


def test_messages_give_a_pure_number_no_unit():
    assert unit(PURE) == "1" and unit(FORCE) == "N"
    assert "hold it to 0.3, hardly less than the 0.4 that" in hardly_held(PURE)
    assert "hold it to 0.3 N, hardly less than the 0.4 that" in hardly_held(FORCE)
    assert estimate_text(KNOWN) == "1.25 (95 %: 1.05 to 1.45)"
    assert "must lie in 0 to 2, got 3.0;" in refused(Quantity("1", 0, 2, "test"), 3.0)
    assert "must lie in 0 to 2 N, got 3.0;" in refused(Quantity("N", 0, 2, "test"), 3.0)
    with pytest.raises(ValueError, match="bounds 2 to 1 are reversed"):
        Quantity("1", 2, 1, "test")


def test_a_sentence_gives_a_pure_number_no_unit(example):
    effect = NamedEffect("filling", (), 0.001, {"exponent": KNOWN})
    assert "filling (exponent 1.25)" in sentence(replace(example, effects=(effect,)))


def test_tables_leave_the_unit_of_a_pure_number_blank(example, capsys):
    moved = {PURE: Moved(1.0, KNOWN, True), FORCE: Moved(0.5, replace(KNOWN, unit="N"), False)}
    assert [row[4] for row in moved_table(moved).rows] == ["", "N"]
    assert effect_table(NamedEffect("filling", (), 0.001, {"exponent": KNOWN})).rows[0][3] == ""
    print_fit(replace(example, parameters=moved))
    lines = capsys.readouterr().out.splitlines()
    pure, force = (next(line for line in lines if path in line) for path in moved)
    assert re.search(r"1\.05 to 1\.45 │ +│ differs", pure)
    assert re.search(r"1\.05 to 1\.45 │ N +│", force)


SIZE = {"force_n": Estimate(3.66, 3.5, 3.8, "N")}
FRICTION = NamedEffect("contact_friction", ("quadratic_drag",), 0.001, SIZE)
SPRING = NamedEffect("linear_spring", (), 0.001, SIZE)


def test_a_rival_ends_before_the_next_effect():
    text = "contact friction (force 3.66 N), or quadratic drag, and linear spring (force 3.66 N)"
    assert sized_effects([FRICTION, SPRING]) == text


def test_effects_without_a_rival_stand_side_by_side():
    text = "linear spring (force 3.66 N) and contact friction (force 3.66 N), or quadratic drag"
    assert sized_effects([SPRING, FRICTION]) == text
    assert sized_effects([]) == ""


def test_stribeck_is_a_name():
    speed = {"stribeck_speed_mm_per_s": Estimate(3.0, 2.5, 3.9, "mm/s")}
    friction = NamedEffect("coulomb_friction", (), 0.001, speed)
    assert effect_sizes(friction) == "Stribeck speed 3 mm/s"
