"""Signals and trials that the proposed model fits worse than the model as it was given."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.result.misfit import TrialRecord
from pma_gym.discovery.thresholds import BLOCK_S, SIGNIFICANT, WORSE_BLOCKS, WORSE_FLOORS

Array = NDArray[np.float64]


def worsened(
    records: Sequence[TrialRecord], floors: Mapping[str, float], seed: int
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Signals, by column, and trials, by name, that are fitted worse by more than their interval.

    Args:
        records: measured trials, and as the given and the proposed model have them.
        floors: noise of each signal, by column, in its unit inside (SI).
        seed: of the bootstrap.
    """
    columns = records[0].columns if records else ()
    growth = {name: [_growth(each, c) for each in records] for c, name in enumerate(columns)}
    names = [name for name in columns if floors.get(name)]
    signals, trials = [], []
    tests = len(names) + len(records)
    for number, name in enumerate(names):
        level = floors[name]
        sums = np.concatenate([part[0] for part in growth[name]])
        counts = np.concatenate([part[1] for part in growth[name]])
        if _grows(sums / level**2, counts, SIGNIFICANT / tests, [seed, number]):
            signals.append(name)
    for number, record in enumerate(records):
        parts = [
            (growth[name][number][0] / floors[name] ** 2, growth[name][number][1]) for name in names
        ]
        if not parts:
            continue
        sums, counts = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
        if len(records) > 1 and _grows(sums, counts, SIGNIFICANT / tests, [seed, 100 + number]):
            trials.append(record.name)
    return tuple(signals), tuple(trials)


def _growth(record: TrialRecord, channel: int) -> tuple[Array, Array]:
    """By block, how much the squared misfit grows (SI), and how many readings it has."""
    before, after = (
        (curve[:, channel] - record.measured[:, channel]) ** 2
        for curve in (record.before, record.after)
    )
    known = np.isfinite(before) & np.isfinite(after)
    duration = float(record.time[-1] - record.time[0])
    count = max(1, round(duration / BLOCK_S))
    places = (record.time - record.time[0]) * (count / max(duration, 1e-300) * (1.0 - 1e-12))
    block = places.astype(np.int64)
    difference = np.where(known, after - before, 0.0)
    return (
        np.bincount(block, difference, count).astype(float),
        np.bincount(block, known.astype(float), count).astype(float),
    )


def _grows(sums: Array, counts: Array, chance: float, seed: Sequence[int]) -> bool:
    """Whether a mean square grows by more than chance; both over blocks."""
    there = counts > 0.0
    sums, counts = sums[there], counts[there]
    blocks = len(counts)
    if blocks < WORSE_BLOCKS or sums.sum() <= WORSE_FLOORS**2 * counts.sum():
        return False
    drawn = np.random.default_rng(seed).multinomial(blocks, np.full(blocks, 1.0 / blocks), 4000)
    means = (drawn @ sums) / np.maximum(drawn @ counts, 1.0)
    return bool(np.quantile(means, chance) > 0.0)
