"""Limits of the readers: settable, and said in one message."""

import pytest

from pma_gym.limits import LIMITS, LimitError, check_limit, limit
from pma_gym.units import parse_number


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_is_kept_and_the_message_says_how_to_raise_it(name, monkeypatch):
    check_limit("log.csv", name, LIMITS[name].usual)
    with pytest.raises(LimitError, match=f"log.csv .* PMA_GYM_MAX_{name.upper()} "):
        check_limit("log.csv", name, LIMITS[name].usual + 1)
    monkeypatch.setenv(f"PMA_GYM_MAX_{name.upper()}", str(LIMITS[name].usual + 1))
    check_limit("log.csv", name, LIMITS[name].usual + 1)


@pytest.mark.parametrize("text", ["", "0", "-1", "1e9", "1_000", "٣", "9" * 30])
def test_a_limit_that_is_no_positive_whole_number_is_refused(text, monkeypatch):
    monkeypatch.setenv("PMA_GYM_MAX_ROWS", text)
    with pytest.raises(LimitError, match="PMA_GYM_MAX_ROWS must be a positive whole number"):
        limit("rows")


@pytest.mark.parametrize(
    "text", ["", " ", "nan", "inf", "1_000", "1,5", "٣", "１", "0x10", "1e400", "1e", ".", "1 2"]
)
def test_what_is_no_decimal_number_is_none(text):
    assert parse_number(text) is None


@pytest.mark.parametrize("text", ["1", "-1.5", "+.5", "5.", "1e-3", " 2\r\n", "1E+05"])
def test_a_decimal_number_is_pythons(text):
    assert parse_number(text) == float(text)
