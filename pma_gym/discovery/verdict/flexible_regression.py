"""How much of a residual a flexible regression on state, command and its history explains.

What repeats with the state or the command is structure that the model lacks, whatever its law; what
does not is noise. A ridge regression on piecewise linear functions of every variable, and on random
functions of all together, predicts each part of the readings from the others; what it explains
there is counted, so that a regression that only learns noise explains nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]
Places = NDArray[np.int64]

MEMORIES_S = (0.03, 0.1, 0.3, 1.0, 3.0)
"""Time constants of the command's history (s): from a delay to a creep of the station."""

KNOTS = 8
"""Knots of a variable's piecewise linear function, at its quantiles."""

RANDOM = 60
"""Random functions of all variables."""

RIDGES = 10.0 ** np.arange(-1.0, 6.0)
"""Ridge penalties, in readings; the one that predicts best is taken."""

MOST_ROWS = 12_000
"""Rows of the regression; where there are more, neighbours are averaged."""


@dataclass(frozen=True)
class Explained:
    """What the regression explains of a residual's readings that it was not fitted to.

    Attributes:
        share: mean square explained, in mean squares of the floor, summed over each block,
            shape (blocks,).
        counts: readings of each block, shape (blocks,).
    """

    share: Array
    counts: Array

    @property
    def mean(self) -> float:
        """Mean square explained, in mean squares of the floor; negative where it predicts worse."""
        return float(self.share.sum() / max(self.counts.sum(), 1.0))

    def bound(self, chance: float, generator: np.random.Generator, draws: int = 4000) -> float:
        """Upper bound of `mean` by resampling blocks.

        Args:
            chance: that the mean lies above it.
            generator: draws the blocks.
            draws: how many resampled sets.
        """
        blocks = len(self.counts)
        drawn = generator.multinomial(blocks, np.full(blocks, 1.0 / blocks), draws)
        means = (drawn @ self.share) / np.maximum(drawn @ self.counts, 1.0)
        return float(np.quantile(means, 1.0 - chance))


def variables(logged: Logged, simulated: Array) -> Array:
    """State, command and its history in each row of a trial, shape (rows, variables).

    Args:
        logged: the trial.
        simulated: what the model's sensors hold (SI), shape (signals, rows).
    """
    time = logged.time
    moving = (logged.row(simulated, each) for each in ("displacement", "pressure"))
    columns = [*simulated, *(np.gradient(row, time) for row in moving)]
    for command in (logged.motor, logged.regulator):
        columns += [command, np.maximum.accumulate(command), np.minimum.accumulate(command)]
        columns += [command - _smoothed(command, time, memory) for memory in MEMORIES_S]
        columns += [_since_turn(command)]
    return np.nan_to_num(np.stack(columns, axis=1))


def explained(
    residuals: Sequence[Array],
    given: Sequence[Array],
    groups: Sequence[Places],
    blocks: Sequence[Places],
    seed: int,
) -> Explained:
    """What a regression explains of whitened residuals in groups that it was not fitted to.

    Args:
        residuals: of each trial, in floors, NaN where there is none, shape (rows,).
        given: `variables` of each trial.
        groups: of each row, the part with which it is left out.
        blocks: of each row, its block; blocks of different trials have different numbers.
        seed: of the random functions.
    """
    rows = np.concatenate([np.isfinite(each) for each in residuals])
    width = max(1, int(np.ceil(np.count_nonzero(rows) / MOST_ROWS)))
    target = np.concatenate(list(residuals))[rows]
    inputs = np.concatenate(list(given))[rows]
    group = np.concatenate(list(groups))[rows]
    block = np.concatenate(list(blocks))[rows]
    target, inputs, group, block, counts = _averaged(target, inputs, group, block, width)
    basis = _basis(inputs, np.random.default_rng(seed))
    parts = np.unique(group)
    grams = {part: _products(basis[group == part], target[group == part]) for part in parts}
    whole = sum(gram for gram, _ in grams.values()), sum(cross for _, cross in grams.values())
    predicted = np.zeros((len(RIDGES), len(target)))
    for part, (gram, cross) in grams.items():
        values, vectors = np.linalg.eigh(whole[0] - gram)
        along = vectors.T @ (whole[1] - cross)
        here = basis[group == part] @ vectors
        shrunk = along[:, None] / (np.maximum(values, 0.0)[:, None] + RIDGES[None, :] / width)
        predicted[:, group == part] = (here @ shrunk).T
    gain = counts * (target**2 - (target - predicted) ** 2)
    best = gain[int(np.argmax(gain.sum(axis=1)))]
    numbers = np.unique(block, return_inverse=True)[1]
    return Explained(
        np.bincount(numbers, best).astype(float), np.bincount(numbers, counts).astype(float)
    )


def _smoothed(command: Array, time: Array, memory: float) -> Array:
    """A command behind a first-order lag that began settled (exact for held commands)."""
    shares = 1.0 - np.exp(-np.diff(time, prepend=time[0]) / memory)
    smoothed, value = np.empty(len(command)), float(command[0])
    for row, (share, now) in enumerate(zip(shares.tolist(), command.tolist(), strict=True)):
        value += share * (now - value)
        smoothed[row] = value
    return smoothed


def _since_turn(command: Array) -> Array:
    """How far a command has gone since it last turned."""
    moves = np.diff(command, prepend=command[0])
    direction = np.sign(moves)
    # A hold keeps the direction that it was reached in.
    held = np.maximum.accumulate(np.where(direction != 0.0, np.arange(len(moves)), 0))
    direction = direction[held]
    turns = np.flatnonzero(np.diff(direction, prepend=direction[0]) != 0.0)
    starts = np.zeros(len(command), np.int64)
    starts[turns] = np.maximum(turns - 1, 0)
    return command - command[np.maximum.accumulate(starts)]


def _averaged(
    target: Array, inputs: Array, group: Places, block: Places, width: int
) -> tuple[Array, Array, Places, Places, Array]:
    """Rows averaged over neighbours of one block, and how many readings each stands for."""
    edges = np.flatnonzero(np.diff(block, prepend=block[:1] - 1))
    starts = np.concatenate(
        [np.arange(a, b, width) for a, b in zip(edges, [*edges[1:], len(block)], strict=True)]
    )
    counts = np.diff(np.append(starts, len(block))).astype(float)
    mean = np.add.reduceat(inputs, starts, axis=0) / counts[:, None]
    return np.add.reduceat(target, starts) / counts, mean, group[starts], block[starts], counts


def _basis(inputs: Array, generator: np.random.Generator) -> Array:
    """A constant, piecewise linear functions of each variable, random functions of all."""
    spread = inputs.std(axis=0)
    moving = spread > 1e-9 * np.maximum(np.abs(inputs).max(axis=0), 1e-300)
    scaled = (inputs[:, moving] - inputs[:, moving].mean(axis=0)) / spread[moving]
    columns = [np.ones(len(inputs))]
    for column in scaled.T:
        knots = np.unique(np.quantile(column, np.linspace(0.0, 1.0, KNOTS)))
        columns.append(column)
        columns += [np.maximum(column - knot, 0.0) for knot in knots[1:-1]]
    if scaled.shape[1]:
        weights = generator.normal(size=(scaled.shape[1], RANDOM)) / np.sqrt(scaled.shape[1])
        mixed = scaled @ weights + generator.uniform(0.0, 2.0 * np.pi, RANDOM)
        columns += list(np.cos(mixed).T)
    basis = np.stack(columns, axis=1)
    size = np.sqrt(np.mean(basis**2, axis=0))
    return basis / np.where(size > 0.0, size, 1.0)


def _products(basis: Array, target: Array) -> tuple[Array, Array]:
    return basis.T @ basis, basis.T @ target
