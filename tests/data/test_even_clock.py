"""Time stamps that a logger rounded are set back to the even steps of its clock; others are not."""

import numpy as np
import pytest

from pma_gym.data.files.even_clock import even_clock


@pytest.mark.parametrize(
    ("rate", "quantum"),
    [(384.0, 1e-3), (384.0, 1e-2), (384.0, 1e-4), (1000 / 7, 1e-2), (333.0, 1e-3), (60.0, 1e-2)],
)
@pytest.mark.parametrize("begin", [0.0, 0.0004, 12.34567, 1.7e9])
@pytest.mark.parametrize("way", [np.rint, np.floor])
def test_rounded_stamps_become_even(rate, quantum, begin, way):
    true = begin + np.arange(2000) / rate
    clock = even_clock(quantum * way(true / quantum + 1e-6))
    assert clock is not None
    assert clock.quantum == pytest.approx(quantum)
    assert clock.step == pytest.approx(1 / rate, rel=1e-4 if quantum < 1e-2 else 1e-3)
    # A constant shift of all stamps, commands and readings alike, changes nothing.
    away = (clock.time - clock.time[0]) - (true - true[0])
    assert np.max(np.abs(away)) < 0.6 * quantum
    assert np.max(np.abs(np.diff(clock.time, 2))) < 1e-6


def test_rows_may_be_missing():
    true = np.delete(np.arange(3000) / 384.0, np.r_[500:700, 1500, 1501, 2200])
    clock = even_clock(np.rint(true * 1e3) / 1e3)
    assert clock is not None
    assert np.max(np.abs(clock.time - true)) < 4e-4
    assert clock.words().startswith("time_s is rounded to 1 ms by the logger")


def test_milliseconds_as_whole_numbers_times_a_factor():
    stamps = 0.001 * np.rint(1e3 * np.arange(1000) / 384.0)
    clock = even_clock(stamps)
    assert clock is not None
    assert clock.step == pytest.approx(1 / 384, rel=1e-5)


@pytest.mark.parametrize(
    "stamps",
    [
        pytest.param(np.arange(1000) * 0.01, id="even"),
        pytest.param(np.arange(1000) / 384.0, id="not rounded"),
        pytest.param(
            np.rint(np.arange(1000) / 384.0 * 1e6) / 1e6, id="rounded too finely to matter"
        ),
        pytest.param(np.delete(np.arange(1000) * 0.01, [200, 500]), id="two rows are missing"),
        pytest.param(
            np.cumsum(0.005 + 1e-3 * np.random.default_rng(1).integers(-2, 3, 1000)), id="uneven"
        ),
        pytest.param(
            np.cumsum(0.002 + 1e-3 * np.random.default_rng(2).integers(0, 2, 1000)),
            id="two lengths of step at random",
        ),
        pytest.param(np.arange(8) / 384.0, id="few"),
    ],
)
def test_other_stamps_stay(stamps):
    assert even_clock(stamps) is None
