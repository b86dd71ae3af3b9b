"""The smoothed latent force of a trial.

Rauch, Tung and Striebel's pass from the last row to the first.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.estimation.innovations import LATENT, SPEEDS, GreyBox, Point

Array = NDArray[np.float64]

SINGULAR = 1e-9
"""Eigenvalues of correlations below this share of the largest are rounding: a friction with a short
presliding leaves nearly none."""


@dataclass(frozen=True)
class Smoothed:
    """What is known of a trial after all of it, shape (rows,) each (SI).

    Attributes:
        time: of the rows.
        force: latent force.
        deviation: its standard deviation.
        position: of the slide or joint.
        speed: its rate.
        command: at the rows.
    """

    time: Array
    force: Array
    deviation: Array
    position: Array
    speed: Array
    command: Array


def smoothed(box: GreyBox, point: Point, number: int) -> Smoothed:
    """Smooth one trial.

    Args:
        box: the filter.
        point: its numbers.
        number: of the trial.

    Source:
        H. E. Rauch, F. Tung, C. T. Striebel 1965, "Maximum likelihood estimates of linear dynamic
        systems", AIAA Journal 3.
    """
    kept, trial = box.kept(number, point), box.rows[number]
    mean, spread = kept.corrected.copy(), kept.certain.copy()
    for k in range(len(mean) - 2, -1, -1):
        gain = kept.certain[k] @ kept.transition[k + 1].T @ _inverse(kept.spread[k + 1])
        mean[k] += gain @ (mean[k + 1] - kept.predicted[k + 1])
        spread[k] += gain @ (spread[k + 1] - kept.spread[k + 1]) @ gain.T
    at = {name: i for i, name in enumerate(kept.states)}
    latent, position = at[f"memory_{LATENT}"], at[box.model.rig.signals[0].name]
    deviation = np.sqrt(np.maximum(spread[:, latent, latent], 0.0))
    command = trial.mean_commands(point.delay, point.pace)
    return Smoothed(
        trial.time,
        mean[:, latent],
        deviation,
        mean[:, position],
        mean[:, at[SPEEDS[box.model.plant]]],
        command,
    )


def _inverse(covariance: Array) -> Array:
    """Inverse within the directions that are uncertain, whatever the units of the states."""
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    units = np.outer(spread, spread) + (np.outer(spread, spread) == 0.0)
    return np.linalg.pinv(covariance / units, rcond=SINGULAR, hermitian=True) / units
