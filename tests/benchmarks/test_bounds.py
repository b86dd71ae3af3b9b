"""Achievable bounds of a page: as few as are needed, kept for the next."""

import numpy as np
import pytest

from benchmarks.bounds import BOUNDS, Bounds
from benchmarks.report.verdicts import largest_excess


def test_as_few_bounds_as_are_needed_give_the_largest_excess():
    generator = np.random.default_rng(3)
    asked = []
    for _ in range(200):
        trials = [("rotation", float(kpa)) for kpa in range(8)]
        means = dict(zip(trials, generator.uniform(0.1, 0.4, 8).tolist(), strict=True))
        least = dict(zip(trials, generator.uniform(0.0, 0.2, 8).tolist(), strict=True))
        seen = []

        def bound(task, kpa, least=least, seen=seen):
            seen.append(kpa)
            return least[task, kpa]

        assert largest_excess(means, bound) == max(means[t] - least[t] for t in trials)
        asked.append(len(seen))
    assert min(asked) == 1 and np.mean(asked) < 5


def table(model, task, kpa):
    return 1e-3 * kpa


def refuses(model, task, kpa):
    raise AssertionError("it was computed again")


def test_a_bound_is_computed_once_and_kept(tmp_path):
    assert Bounds("station", tmp_path, table)("rotation", 300.0) == 0.3
    kept = Bounds("station", tmp_path, refuses)
    assert kept("rotation", 300.0) == 0.3
    # Of another model nothing is known.
    with pytest.raises(AssertionError):
        Bounds("serres2008", tmp_path, refuses)("rotation", 300.0)


@pytest.mark.parametrize("content", ["", "[]", '{"bounds": 3}', '{"key": 1, "bounds": [[1]]}'])
def test_a_damaged_file_of_bounds_counts_as_none(content, tmp_path):
    (tmp_path / BOUNDS).write_text(content)
    assert Bounds("station", tmp_path, table)("rotation", 500.0) == 0.5
