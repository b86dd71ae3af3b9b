"""Prepared rows, and loops that step environments, for all workers."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

EPISODE = 501
"""Control steps of a trial where a peer has no episodes of its own."""

ACTIONS = 256
"""Actions drawn beforehand, used over and over."""

BATCHES = 16
"""Batches of actions drawn beforehand."""


class Missing(Exception):
    """A row that cannot be measured here; the message says why, in a few words."""


@dataclass(frozen=True)
class Prepared:
    """A row that is ready to be measured: compiled, allocated, reset.

    Attributes:
        chunk: goes on for some steps; how many it made.
        facts: what else is to be told of the row, asked for after every measurement.
    """

    chunk: Callable[[], int]
    facts: Callable[[], Mapping[str, Any]] = field(default=dict)


def single(environment: Any, actions: Sequence[Any]) -> Prepared:  # noqa: ANN401
    """Steps of one Gymnasium environment; what its resets take counts too.

    Args:
        environment: the environment.
        actions: taken one after the other, over and over.
    """
    step, reset = environment.step, environment.reset
    reset()

    def chunk() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                reset()
        return len(actions)

    return Prepared(chunk)


def vector(environment: Any, batches: Iterable[Any], count: int) -> Prepared:  # noqa: ANN401
    """Steps of a vector environment that resets its environments itself.

    Args:
        environment: the vector environment.
        batches: one array of actions a step, taken one after the other, over and over.
        count: number of environments.
    """
    step, batches = environment.step, list(batches)
    environment.reset()
    at = 0

    def chunk() -> int:
        nonlocal at
        # One step of a large batch is long enough to look at the clock after.
        steps = max(1, 1024 // count)
        for _ in range(steps):
            step(batches[at % len(batches)])
            at += 1
        return steps * count

    return Prepared(chunk)
