"""What the smoothed latent force goes with, and in which trial it acts most."""

from collections.abc import Sequence

import numpy as np

from pma_gym.data.trial_columns import BY_QUANTITY, Column
from pma_gym.discovery.grey_box.thresholds import CONFIDENCE
from pma_gym.discovery.report.figure_text import percent, signal_name
from pma_gym.discovery.result.misfit import LatentForce, ResidualLaw
from pma_gym.estimation.smoother import Smoothed
from pma_gym.plant.model import Model
from pma_gym.plant.rigs.rig import Rig
from pma_gym.plant.sensors import direct_command
from pma_gym.units import SI_FACTORS

FORCES = {"slide": ("force on the slide", "N"), "joint": ("torque on the joint", "N m")}
"""What a latent force is, and its unit, by rig."""

BINS, LEAST_BINS = 12, 3
"""Of a law that is drawn from the smoothed force, and the fewest that make one."""


def latent_law(trials: Sequence[Smoothed], rig: Rig, rows: float) -> ResidualLaw | None:
    """The law, in bins of the position or the speed, whichever explains more of the force.

    Args:
        trials: smoothed forces (N, N m).
        rig: a slide or a joint.
        rows: that count as one independent value: two memories of the force.
    Returns:
        Means with 95 % bands; None where neither position nor speed varies.
    """
    force = np.concatenate([each.force for each in trials])
    columns = [BY_QUANTITY[signal.name] for signal in rig.signals[:2]]
    values = [[each.position for each in trials], [each.speed for each in trials]]
    best = None
    for column, parts in zip(columns, values, strict=True):
        x = np.concatenate(parts)
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
        bins = len(edges) - 1
        if bins < LEAST_BINS:
            continue
        of = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
        count = np.maximum(np.bincount(of, minlength=bins), 1)
        mean = np.bincount(of, force, bins) / count
        off = (force - mean[of]) ** 2
        explained = 1.0 - float(np.mean(off)) / max(float(np.mean(force**2)), 1e-300)
        spread = np.sqrt(np.bincount(of, off, bins) / count / np.maximum(count / rows, 1.0))
        at = 0.5 * (edges[:-1] + edges[1:]) / SI_FACTORS[column.unit]
        if best is None or explained > best[0]:
            best = explained, column, at, mean, CONFIDENCE * spread
    if best is None:
        return None
    explained, column, at, mean, wide = best
    what, unit = FORCES[rig.name]
    share = percent(max(explained, 0.0))
    words = f"goes with {signal_name(column.name)}: that explains {share} of its mean square"
    return ResidualLaw(
        f"{what} ({unit})", _label(column), at, mean, mean - wide, mean + wide, words
    )


def latent_force(model: Model, before: Smoothed, after: Smoothed | None) -> LatentForce:
    """One trial's latent force, over all that it may go with.

    Args:
        model: of a slide or a joint.
        before: with parameters refitted and nothing added.
        after: with the proposed model; None where that adds nothing.
    """
    names = [signal.name for signal in model.rig.signals[:2]]
    columns = [BY_QUANTITY[n] for n in (*names, direct_command(model) or "motor_voltage")]
    values = (before.position, before.speed, before.command)
    over = {_label(c): v / SI_FACTORS[c.unit] for c, v in zip(columns, values, strict=True)}
    what, unit = FORCES[model.rig.name]
    return LatentForce(f"{what} ({unit})", before.force, after and after.force, over)


def _label(column: Column) -> str:
    """Of an axis."""
    return f"{signal_name(column.name).replace('_', ' ')} ({column.unit})"


def largest_share(trials: Sequence[Smoothed]) -> tuple[int, float]:
    """The trial with most of the latent force (mean square), and its share."""
    squares = np.array([float(np.sum(each.force**2)) for each in trials])
    largest = int(np.argmax(squares))
    return largest, float(squares[largest] / max(float(squares.sum()), 1e-300))
