"""Statistics over training seeds: pooled errors and their intervals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.report.errors import Errors
from benchmarks.report.statistics import SEED, Interval, interquartile_mean, positive_interval

WITHIN = 2.0
"""Factor on the best seed's error within which a seed counts as having worked."""


@dataclass(frozen=True)
class Pool:
    """Errors of policies that differ in their training seed, in the same cases of a suite.

    Attributes:
        errors: a row a seed.
    """

    errors: Errors

    @property
    def by_seed(self) -> NDArray[np.float64]:
        """Interquartile mean of every seed, shape (seeds,)."""
        return np.asarray(interquartile_mean(self.errors.values))

    @property
    def reliable(self) -> int:
        """How many seeds end within twice the best seed's error."""
        means = self.by_seed
        return int(np.sum(means <= WITHIN * means.min()))

    @property
    def mean(self) -> Interval:
        """Interquartile mean over seeds and cases, seeds and stations resampled.

        Source: Agarwal et al. 2021, see `benchmarks.report.statistics`; stratified as there,
        each resample also draws the seeds anew, with replacement.
        """
        values, draws = self.errors.values, self.errors.draws
        generator = np.random.default_rng(SEED)
        drawn = [
            float(interquartile_mean(_chosen(values, generator, cases))) for cases in draws.cases
        ]
        estimate = float(interquartile_mean(values.ravel()))
        return positive_interval(estimate, np.array(drawn), draws)


def _chosen(
    values: NDArray[np.float64], generator: np.random.Generator, cases: NDArray[np.int64]
) -> NDArray[np.float64]:
    seeds = generator.integers(len(values), size=len(values))
    return values[np.ix_(seeds, cases)].ravel()
