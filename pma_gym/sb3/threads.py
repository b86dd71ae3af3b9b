"""One thread for work that is done over and over, or two, whichever is faster lately."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import torch

FIRST = 3
"""Times that one thread alone does the work at first, to know what it takes."""

PATIENCE = 2.0
"""What two threads may lose against one before they are given up: in times of one thread."""

PAUSES_S = (0.5, 8.0)
"""The shortest and the longest pause until two threads are tried again."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """PyTorch has so many threads meanwhile."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class ThreadTuner:
    """Chooses by how long the work has taken.

    PyTorch's threads wait for each other many times in a minibatch. Where another program wants a
    core too, they often wait for a whole turn of that one's: of two trainings at once on two cores
    (Xeon), with two threads each, each took 5 times as long as alone with minibatches of 4096, and
    more than 50 times with 1024. So two threads are given up as soon as they have lost more than
    `PATIENCE`, and tried again after a pause, which doubles while they go on losing.

    It is for work whose result does not depend on the number of threads.
    """

    def __init__(self) -> None:
        self._alone: list[float] = []
        self._lost = 0.0
        self._pause_s = PAUSES_S[0]
        self._since = self._until = -math.inf

    @contextmanager
    def work(self, amount: float) -> Iterator[None]:
        """Do so much work meanwhile, in any unit, with the threads that it takes."""
        start = time.perf_counter()
        count = 2 if len(self._alone) >= FIRST and start >= self._until else 1
        with threads(count):
            yield
        end = time.perf_counter()
        taken = (end - start) / amount
        if count == 1:
            # The latest ones, for what one thread takes is another thing beside another program.
            self._alone = [*self._alone[1 - FIRST :], taken]
            self._since = end
            return
        self._lost = max(0.0, self._lost + taken / min(self._alone) - 1.0)
        if self._lost > PATIENCE:
            # Where they have gone well for long, it is another disturbance.
            if start - self._since > 4.0 * self._pause_s:
                self._pause_s = PAUSES_S[0]
            self._until, self._lost = end + self._pause_s, 0.0
            self._pause_s = min(2.0 * self._pause_s, PAUSES_S[1])
