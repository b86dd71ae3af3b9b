"""Times that repeat or fall back: each cause gets its own fix, and following it cures the log.

Time stamps that a logger rounded are set back to the even steps of its clock; others are not.
"""

import re

import numpy as np
import pytest

from pma_gym.data.files.even_clock import even_clock
from pma_gym.data.time_order import time_disorder

STEP = 0.01
EVEN = np.round(np.arange(400) * STEP, 9)
RAGGED = np.cumsum(0.008 + 0.004 * np.random.default_rng(1).random(400))


def said(time):
    return time_disorder(np.asarray(time, float), "row {} of a.csv".format)


def swapped(time, *at):
    time = time.copy()
    for index in at:
        time[[index, index + 1]] = time[[index + 1, index]]
    return time


@pytest.mark.parametrize("time", [EVEN, RAGGED])
def test_times_that_increase_are_not_spoken_of(time):
    assert said(time) == ""


CASES = {
    "two rows swapped": (swapped(EVEN, 57), "out of order: sort"),
    "the first rows swapped": (swapped(EVEN, 1), "out of order: sort"),
    "the last rows swapped": (swapped(EVEN, 398), "out of order: sort"),
    "ragged rows swapped": (swapped(RAGGED, 57, 200), "out of order: sort"),
    "blocks swapped": (np.roll(EVEN, 123), "out of order: sort"),
    "shuffled": (np.random.default_rng(3).permutation(EVEN), "out of order: sort"),
    "a late packet": (np.r_[EVEN[:90], EVEN[100:110], EVEN[90:100], EVEN[110:]], "order: sort"),
    "a swap and a gap": (swapped(np.delete(EVEN, range(200, 220)), 57), "out of order: sort"),
    "newest first": (EVEN[::-1], "the newest first: sort"),
    "three trials": (np.tile(EVEN, 3), "begins again, a new trial: split .* row 400, row 800"),
    "two trials, other start": (np.r_[EVEN, EVEN + 0.004], "a new trial: split"),
    "a short second trial": (np.r_[EVEN, RAGGED[40:90] - RAGGED[0]], "a new trial: split"),
    "a block twice": (np.r_[EVEN[:250], EVEN[150:]], "row 250 on, rows have times .* one copy"),
    "16 bits of ms": ((EVEN * 10 + 50) % 65.536, "65.536 s again.*: add 65.536 s .* row 156"),
    "32 bits of us": ((EVEN + 4293) % 4294.967296, "range of 4294.9673 s again"),
    "seconds of a minute": ((EVEN + 58.5) % 60, "range of 60 s again, .*: add 60 s .* row 150"),
    "half a day": ((EVEN + 43198) % 43200, "range of 43200 s again"),
    "daylight saving": (np.r_[EVEN, EVEN + 4 - 3600], "saving time.*: add 3600 s .* row 400"),
    "set back by NTP": (np.r_[EVEN, EVEN + 4 - 0.055], "was set back: add 0.055 s"),
    "too few digits": (np.floor(EVEN * 10) / 10, "too few digits .* by 0.1 s or more: log more"),
    "stands still": (0 * EVEN, "the clock stands still"),
    "one row repeated": (np.insert(EVEN, 57, EVEN[57]), "two rows have one time: correct it"),
    "scatter": (EVEN + 0.03 * np.random.default_rng(2).random(400), "scatter by more than a row"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_fix_follows_from_the_cause(case):
    time, fix = CASES[case]
    message = said(time)
    assert re.search(fix, message), message
    assert ("sort" in message) == ("sort" in fix or case == "scatter")


def test_where_how_often_and_by_how_much_is_told():
    message = said(swapped(EVEN, 57, 100, 150, 200, 380))
    assert message.startswith(
        "row 58 of a.csv has 0.57 s after 0.58 s, and so on in 5 of 399 steps"
    )
    assert "(row 58, row 101, row 151 and 2 more), where it falls back by 0.01 s;" in message


@pytest.mark.parametrize("case", ["16 bits of ms", "seconds of a minute", "set back by NTP"])
def test_the_time_to_add_makes_the_clock_even(case):
    time, _ = CASES[case]
    back = 1 + int(np.flatnonzero(np.diff(time) < 0)[0])
    added = float(said(time).partition("add ")[2].partition(" s")[0])
    cured = np.r_[time[:back], time[back:] + added]
    np.testing.assert_allclose(np.diff(cured), np.diff(cured)[0], atol=1e-6)


@pytest.mark.parametrize(
    ("rate", "quantum"),
    [(384.0, 1e-3), (384.0, 1e-2), (384.0, 1e-4), (1000 / 7, 1e-2), (333.0, 1e-3), (60.0, 1e-2)],
)
@pytest.mark.parametrize("begin", [0.0, 0.0004, 12.34567, 1.7e9])
@pytest.mark.parametrize("way", [np.rint, np.floor])
def test_rounded_stamps_become_even(rate, quantum, begin, way):
    true = begin + np.arange(2000) / rate
    clock = even_clock(quantum * way(true / quantum + 1e-6))
    assert clock.quantum == pytest.approx(quantum)
    assert clock.step == pytest.approx(1 / rate, rel=1e-4 if quantum < 1e-2 else 1e-3)
    # A constant shift of all stamps, commands and readings alike, changes nothing.
    away = (clock.time - clock.time[0]) - (true - true[0])
    assert np.max(np.abs(away)) < 0.6 * quantum
    assert np.max(np.abs(np.diff(clock.time, 2))) < 1e-6


def test_rows_may_be_missing():
    true = np.delete(np.arange(3000) / 384.0, np.r_[500:700, 1500, 1501, 2200])
    clock = even_clock(np.rint(true * 1e3) / 1e3)
    assert np.max(np.abs(clock.time - true)) < 4e-4
    assert clock.words().startswith("time_s is rounded to 1 ms by the logger")


def test_milliseconds_as_whole_numbers_times_a_factor():
    stamps = 0.001 * np.rint(1e3 * np.arange(1000) / 384.0)
    clock = even_clock(stamps)
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
