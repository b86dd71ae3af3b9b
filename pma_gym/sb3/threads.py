"""Choice between one and two threads for repeated work, by recent times."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import torch

FIRST = 3
"""Repetitions that a single thread does first, to measure its time."""

PATIENCE = 2.0
"""Loss of two threads against one from which they pause: in times of one thread."""

PAUSES_S = (0.5, 8.0)
"""The shortest and the longest pause until two threads are tried again."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Set the number of PyTorch's threads inside the context."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class ThreadTuner:
    """Chooses the number of threads by the time that the work has taken.

    PyTorch's threads wait for each other many times in a minibatch. Where another program wants a
    core too, they often wait for its whole time slice: of two trainings at once on two cores
    (Xeon), with two threads each, each took 5 times as long as a single training with minibatches
    of 4096, and more than 50 times with 1024. So two threads stop as soon as they have lost more
    than `PATIENCE`, and start again after a pause, which doubles while they go on losing.

    It is for work whose result does not depend on the number of threads.
    """

    def __init__(self) -> None:
        self._alone: list[float] = []
        self._lost = 0.0
        self._pause_s = PAUSES_S[0]
        self._since = self._until = -math.inf

    @contextmanager
    def work(self, amount: float) -> Iterator[None]:
        """Time an amount of work (any unit) inside the context, with the chosen threads."""
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
