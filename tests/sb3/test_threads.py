"""Two threads where they are faster, one where they are not."""

from itertools import pairwise

import pytest

pytest.importorskip("torch")

import torch

import pma_gym.sb3.ppo as sb3_threads
from pma_gym.sb3.ppo import FIRST, PAUSES_S, ThreadTuner, threads


class Clock:
    """Work on a clock of its own: what it takes follows from the threads that it gets."""

    def __init__(self, monkeypatch):
        self.now, self.pace = 100.0, ThreadTuner()
        monkeypatch.setattr(sb3_threads.time, "perf_counter", lambda: self.now)

    def done(self, times, one=1e-3, two=0.6e-3, amount=1.0):
        """The numbers of threads that the work got."""
        had = []
        for _ in range(times):
            with self.pace.work(amount):
                had.append(torch.get_num_threads())
                self.now += (one if had[-1] == 1 else two) * amount
        return had


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


def test_two_threads_that_are_faster_are_kept(clock):
    before = torch.get_num_threads()
    assert clock.done(10_000) == [1] * FIRST + [2] * (10_000 - FIRST)
    assert torch.get_num_threads() == before


def test_what_is_smaller_is_no_faster(clock):
    clock.done(FIRST)
    assert clock.done(100, amount=9.0) + clock.done(100, amount=0.1) == [2] * 200


def test_two_threads_that_lose_are_given_up_and_tried_after_pauses_that_double(clock):
    clock.done(FIRST)
    start = clock.now
    had = clock.done(40_000, two=50e-3)
    tries = [i for i, count in enumerate(had) if count == 2]
    # Each costs 50 ms; between them is work with one thread that takes 1 ms.
    pauses_s = [1e-3 * (later - earlier - 1) for earlier, later in pairwise(tries)]
    assert tries[0] == 0
    assert pauses_s[:5] == pytest.approx([0.5, 1.0, 2.0, 4.0, 8.0], abs=2e-3)
    assert max(pauses_s) == pytest.approx(PAUSES_S[1], abs=2e-3)
    assert clock.now - start < 1.02 * 40_000 * 1e-3


def test_a_little_that_is_lost_again_and_again_is_too_much_but_a_single_long_wait_is_not(clock):
    clock.done(FIRST)
    assert clock.done(60, two=1.1e-3)[:22] == [2] * 21 + [1]
    clock.done(600)
    assert clock.done(1, two=2.9e-3) + clock.done(99) == [2] * 100


def test_pauses_are_short_again_after_a_good_time(clock):
    clock.done(FIRST)
    clock.done(10_000, two=50e-3)
    clock.done(80_000)
    assert clock.done(1, two=50e-3) == [2]
    assert 1e-3 * clock.done(600).index(2) == pytest.approx(PAUSES_S[0], abs=2e-3)


def test_threads_come_back_where_the_work_fails_and_it_counts_for_nothing(clock):
    before = torch.get_num_threads()
    clock.done(FIRST)
    with pytest.raises(KeyError), clock.pace.work(1.0):
        clock.now += 99.0
        raise KeyError
    assert torch.get_num_threads() == before
    assert clock.done(9) == [2] * 9
    with pytest.raises(KeyError), threads(1):
        raise KeyError
    assert torch.get_num_threads() == before
