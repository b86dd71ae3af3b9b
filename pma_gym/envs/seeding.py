"""Gymnasium's `np_random` and `np_random_seed` for episodes with counter-based random numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

SEEDS = 1 << 31
"""Upper bound of drawn seeds, which fits the integers of all libraries."""


class SeededByReset:
    """Derive all random numbers of an episode from the seed of the last `reset`.

    Compiled code computes them from the seed, the episode's number and the step's, and never draws
    from `np_random`. That generator restarts with each seed and serves wrappers and users. A
    generator assigned to `np_random` provides the seed of the next `reset` without a seed.
    """

    _drawn: int | None = None

    @property
    def np_random(self) -> np.random.Generator:
        """Generator with the last seed, for wrappers and users; episodes do not draw from it."""
        return super().np_random  # type: ignore[misc]

    @np_random.setter
    def np_random(self, value: object) -> None:
        if not isinstance(value, np.random.Generator):
            raise TypeError(
                f"np_random must be a numpy.random.Generator, got {type(value).__name__}; set "
                "numpy.random.default_rng(seed), or call reset(seed=...)"
            )
        self._drawn = int(value.integers(SEEDS))

    def _or_drawn(self, seed: Any) -> Any:  # noqa: ANN401
        """The seed that a reset was given, or what was drawn for it from a generator."""
        if seed is None and self._drawn is not None:
            seed = self._drawn
        self._drawn = None
        return seed


def own_seeds(
    given: Sequence[int | None],
    known: Sequence[int | None],
    indices: NDArray[np.int64],
    first: int | None,
) -> list[int | None]:
    """Return the seeds of a batch's environments at a reset, None for those that keep their seed.

    Args:
        given: for every environment, the seed given to the reset, or None.
        known: for every environment, its present seed, or None.
        indices: the environments of the reset.
        first: seed of the first environment, with consecutive seeds for the others, if no seeds are
            given or known; None to draw one for each.
    Returns:
        Seeds in the order of indices.

    >>> both = np.arange(2)
    >>> own_seeds([None, None], [None, None], both, 40), own_seeds([7, None], [3, 4], both, None)
    ([40, 41], [7, None])
    """
    seeds = []
    for i in indices.tolist():
        seed = given[i]
        if seed is None and known[i] is None:
            seed = drawn_seed() if first is None else first + i
        seeds.append(seed)
    return seeds


def drawn_seed() -> int:
    """Draw a seed from the operating system."""
    entropy: Any = np.random.SeedSequence().entropy
    return int(entropy)
