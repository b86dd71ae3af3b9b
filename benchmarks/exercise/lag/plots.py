"""The bounds of an exercise as a picture: least error by the lag, reach by frequency."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from benchmarks.exercise.lag.causal import Causal
from benchmarks.exercise.lag.swing import Swing
from pma_gym.pages.figures import picture, png
from pma_gym.tasks import EVERY_TASK

_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_TREMOR_HZ = (8.0, 12.0)
_ANGLE_DEG = 60.0
"""Angle of the lines that are drawn: one for each pressure."""


def bound_plot(causal: Sequence[Causal], swings: Sequence[Swing]) -> bytes:
    """Both panels as PNG.

    Args:
        causal: least standard deviations.
        swings: the regulator's reach.
    """
    with picture(12.0, 4.8) as figure:
        left, right = figure.subplots(1, 2)
        _draw_least(left, [row for row in causal if _drawn(row.point.angle)])
        _draw_reach(right, [swing for swing in swings if _drawn(swing.point.angle)])
        return png(figure)


def _drawn(angle: float) -> bool:
    return abs(math.degrees(angle) - _ANGLE_DEG) < 1e-6


def _draw_least(axis: Axes, rows: Sequence[Causal]) -> None:
    """Least standard deviation against the lag, and the one at a constant voltage."""
    unit = EVERY_TASK[rows[0].point.task].schedule.unit
    for point, color in zip(dict.fromkeys(row.point for row in rows), _COLORS, strict=False):
        name = f"{1e-3 * point.pressure:.0f} kPa"
        own = [row for row in rows if row.point == point]
        for sensed, line, what in ((True, "-o", "by the sensors"), (False, "--s", "all known")):
            drawn = [row for row in own if row.sensed == sensed and row.delay == own[-1].delay]
            lags = [row.lag for row in drawn]
            least = [row.least for row in drawn]
            axis.plot(lags, least, line, color=color, markersize=4, label=f"{name}, {what}")
        axis.axhline(own[0].uncontrolled, color=color, linestyle=":", linewidth=1.0)
    axis.set(xscale="log", yscale="log", xlabel="time constant of the regulator (s)")
    axis.set(ylabel=f"standard deviation ({unit})")
    axis.set_title(f"Least causal error at {_ANGLE_DEG:g} deg; dotted: constant voltage")
    axis.legend(loc=(0.02, 0.32), ncols=2, frameon=False, fontsize=8.5)


def _draw_reach(axis: Axes, swings: Sequence[Swing]) -> None:
    """Largest moment cancelled against the frequency: by a sine, and above it by any voltage."""
    frequency = np.geomspace(0.1, 30.0, 120)
    for swing, color in zip(swings, _COLORS, strict=False):
        reach = np.array([swing.moment(f) for f in frequency.tolist()])
        name = f"{1e-3 * swing.point.pressure:.0f} kPa, {swing.point.moment:.1f} N m held"
        axis.plot(frequency, reach, color=color, label=name)
        most = [swing.most(f) for f in frequency.tolist()]
        axis.plot(frequency, most, color=color, linestyle=":")
    axis.axvspan(*_TREMOR_HZ, color="#999999", alpha=0.2, linewidth=0, label="tremor")
    axis.set(xscale="log", yscale="log", xlabel="frequency (Hz)", ylabel="moment (N m)")
    axis.set_title("Largest moment cancelled; dotted: by any voltage")
    axis.legend(loc="lower left", frameon=False, fontsize=8.5)
