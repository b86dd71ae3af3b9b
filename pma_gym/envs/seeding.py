"""Gymnasium's `np_random` and `np_random_seed` for episodes that draw by a counter."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

SEEDS = 1 << 31
"""Seeds are drawn below this number, which fits every library's integers."""


class SeededByReset:
    """Everything random in an episode follows from the seed that `reset` was given last.

    Compiled code draws by that seed, the episode's number and the step's, and never from
    `np_random`: that generator begins anew with each seed, and is there for wrappers and users. A
    generator that is set as `np_random` gives the seed of the next `reset` that is given none.
    """

    _drawn: int | None = None

    @property
    def np_random(self) -> np.random.Generator:
        """A generator of the last seed, for wrappers and users; episodes do not draw from it."""
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
    """The seeds that environments of a batch begin anew with, None for those that go on.

    Args:
        given: of every environment, the seed that a reset was given, or None.
        known: of every environment, the seed that it goes by so far, or None.
        indices: which environments the reset is for.
        first: seed of the first environment, the others counting up from it, where nobody gave any;
            None to draw one for each.
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
    """A seed that nobody chose, from the operating system."""
    entropy: Any = np.random.SeedSequence().entropy
    return int(entropy)
