"""Arrays are read by compiled code only where they are laid out as it believes."""

import pytest

from pma_gym.codegen.machine import control


@pytest.fixture
def looked_at_anew():
    control.are_known.cache_clear()
    yield
    control.are_known.cache_clear()


def test_this_numpy_is_known():
    assert control.are_known()


@pytest.mark.parametrize(
    ("member", "other"),
    [
        ("DIMENSIONS", "SIZES"),
        ("SIZES", "STRIDES"),
        ("STRIDES", "SIZES"),
        ("DATA", "STRIDES"),
        ("DTYPE", "DATA"),
        ("TYPE", "DTYPE"),
    ],
)
def test_a_member_that_lies_elsewhere_is_noticed(monkeypatch, looked_at_anew, member, other):
    monkeypatch.setattr(control, member, getattr(control, other))
    assert not control.are_known()
