"""Whether what drifts in a signal is alike in all trials: a sensor's drift is another in each.

A drift is a nuisance of every fit, and takes up what is as slow as it: a leak that opens, creep.
What the fit takes for it, trial by trial, is set against what a drift of a sensor may be. Its waves
u_i have the variances that repeats tell, and a mean of 0. With whitened columns C_i of unit
variance, readings r_i = C_i (m + u_i) + e_i say of a mean m that all trials share

    s = sum_i (I + G_i)^-1 C_i^T r_i,   M = sum_i (I + G_i)^-1 G_i,   G_i = C_i^T C_i,

and s^T M^-1 s is a chi-square of as many degrees as there are waves where m = 0 (a score test).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pma_gym.discovery.preparation.acceptance_floors import TOLERANCE
from pma_gym.discovery.preparation.noise import Whitening
from pma_gym.discovery.preparation.nuisance_projection import drift_columns, line_columns
from pma_gym.discovery.thresholds import ALIKE_BESIDE, ALIKE_CHANCE, ALIKE_TRIALS
from pma_gym.discovery.verdict.adequacy import Adequacy
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

SMALLEST = 1e-9
"""Share of the largest information below which a wave is not seen at all."""


def with_common_drift(
    judged: Adequacy,
    logged: Sequence[Logged],
    left: Sequence[Array],
    noises: Sequence[Whitening],
    beside: bool = False,
) -> Adequacy:
    """With the fault `alike` of adequate signals whose drift is alike in all trials.

    What keeps to a lab's tolerance is good enough, whatever it is.

    Args:
        judged: what is left of the signals.
        logged: the trials, each a run of its own.
        left: simulated less measured (SI), NaN where not measured, shape (signals, rows) each.
        noises: of the signals.
        beside: whether effects were added; their names are withheld, whatever else is wrong.
    """
    signals = dict(judged.signals)
    most = (ALIKE_BESIDE if beside else ALIKE_CHANCE) / max(len(signals), 1)
    for channel, (signal, noise) in enumerate(zip(logged[0].signals, noises, strict=True)):
        known = signals.get(signal.name)
        if known is None or known.floor is None or (known.fault and not beside):
            continue
        if known.floor.source == TOLERANCE:
            continue
        chance = chance_of_common_drift(logged, left, noise, channel)
        if chance < most:
            signals[signal.name] = replace(known, fault="alike", common=chance)
    return Adequacy(signals)


def chance_of_common_drift(
    logged: Sequence[Logged], left: Sequence[Array], noise: Whitening, channel: int
) -> float:
    """Chance that a sensor drifts as much alike in all trials; 1 where it does not drift.

    Args:
        logged: the trials, each a run of its own.
        left: simulated less measured (SI), NaN where not measured, shape (signals, rows) each.
        noise: of the signal.
        channel: the signal.
    """
    pairs = [(a, b) for a, b in zip(logged, left, strict=True) if a.measures[channel]]
    if not noise.drift or len(pairs) < ALIKE_TRIALS:
        return 1.0
    # Trials of other lengths may have more waves; all share the slowest.
    columns = [drift_columns(each, noise.waves) for each, _ in pairs]
    count = min(map(len, columns))
    score, information = np.zeros(count), np.zeros((count, count))
    for (each, part), waves in zip(pairs, columns, strict=True):
        inside, white = _white(each, part[channel], waves[:count], noise, channel)
        products = inside @ inside.T
        shrunk = np.linalg.inv(np.eye(count) + products)
        score += shrunk @ (inside @ white)
        information += shrunk @ products
    information = 0.5 * (information + information.T)
    sizes, axes = np.linalg.eigh(information)
    seen = sizes > SMALLEST * sizes.max(initial=0.0)
    along = axes[:, seen].T @ score
    return float(chi2.sf(np.sum(along**2 / sizes[seen]), int(seen.sum())))


def _white(
    logged: Logged, left: Array, waves: Sequence[Array], noise: Whitening, channel: int
) -> tuple[Array, Array]:
    """Whitened waves, shape (waves, rows), and residual, free of what has any size in a trial."""
    time, missing = logged.time - logged.time[0], logged.missing[channel]
    free = [np.ones(len(time))] if logged.signals[channel].has_free_zero else []
    for hertz in noise.lines:
        free += line_columns(hertz, time)
    known = np.where(np.isfinite(left), left, 0.0)
    rows = np.array([*free, *(noise.drift * each for each in waves), known])
    rows[:, missing] = 0.0
    rows = noise.white(rows, missing)
    if free:
        basis = np.linalg.svd(rows[: len(free)], full_matrices=False)[2]
        rows -= (rows @ basis.T) @ basis
    return rows[len(free) : -1], rows[-1]
