"""EnvPool: batches of environments in C++, on one thread.

That thread and Python's take turns. On two processors each wakes the other across them, which costs
up to half the speed and swings; kept to one processor that is idle they were fastest.
"""

# pyright: reportMissingImports=false
import os
from collections.abc import Iterator
from contextlib import contextmanager

import envpool
import numpy as np

from benchmarks.speed.loops import BATCHES, Missing, Prepared, vector

PACKAGES = ("envpool", "gymnasium", "numpy")


def batch(name: str, count: int, kept: bool = False) -> Prepared:
    """A batch, stepped synchronously; EnvPool resets what has ended.

    Args:
        name: environment.
        count: how many.
        kept: keep both threads to one processor.
    """
    if not kept:
        return _prepared(name, count)
    with _one_processor():
        made = _prepared(name, count)

    def chunk() -> int:
        with _one_processor():
            return made.chunk()

    return Prepared(chunk)


@contextmanager
def _one_processor() -> Iterator[None]:
    """Keep the thread that calls, and those that it starts, to one processor, always the same."""
    if not hasattr(os, "sched_setaffinity"):
        raise Missing("this system does not let a program choose its processors")
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def _prepared(name: str, count: int) -> Prepared:
    environment = envpool.make(
        name, env_type="gymnasium", num_envs=count, batch_size=count, num_threads=1, seed=0
    )
    space, generator = environment.action_space, np.random.default_rng(0)
    if hasattr(space, "n"):
        batches = generator.integers(space.n, size=(BATCHES, count), dtype=np.int32)
    else:
        shape = (BATCHES, count, *space.shape)
        batches = generator.uniform(space.low, space.high, shape).astype(np.float32)
    return vector(environment, batches, count)


ROWS = {"batch": batch}
