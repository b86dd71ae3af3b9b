import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pma_gym.units import SI_FACTORS, Quantity, suffix


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
        ("unknown unit 'psi'; add it to", lambda: Quantity("psi", 0, 1, "test")),
        ("bounds 2 to 1 kPa are reversed", lambda: Quantity("kPa", 2, 1, "test")),
        ("usual must lie in 0 to 1 kPa, got 2", lambda: Quantity("kPa", 0, 1, "test", usual=2)),
    ):
        with pytest.raises(ValueError, match=message):
            act()
