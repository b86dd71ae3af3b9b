"""The budget as a picture: shares by pressure, and a waterfall for every trial."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from benchmarks.budget.tables import unit_of
from benchmarks.budget.trial import Budget
from pma_gym.pages.figures import legend_below, picture, png

COLORS = {
    "rounding": "#882255",
    "chatter": "#CC6677",
    "timing": "#DDCC77",
    "static misfit": "#E69F00",
    "hysteresis": "#117733",
    "dry friction": "#999933",
    "lag": "#332288",
    "pulley": "#0072B2",
    "slack": "#56B4E9",
    "stretch": "#44AA99",
}
"""Colours of the causes: Tol's and Okabe's, told apart by the colour-blind."""

_GREY = "#8a8f98"
_MEASURED: dict[str, Any] = {"marker": "o", "color": "black", "linestyle": "none"}
_IMPROVED: dict[str, Any] = {"marker": "^", "color": "#D55E00", "linestyle": "none"}


def budget_plot(budgets: Sequence[Budget]) -> bytes:
    """Shares and waterfalls of a task's trials as PNG, over all phases.

    Args:
        budgets: of one task, by pressure.
    """
    phase = budgets[0].phases[-1]
    columns = -(-len(budgets) // 2)
    with picture(12.0, 11.5) as figure:
        parts: Any = figure.subfigures(2, 1, height_ratios=(1.0, 1.35))
        upper, lower = parts
        _draw_shares(upper.subplots(), budgets, phase)
        axes: Any = lower.subplots(2, columns, sharex=True, sharey=True, squeeze=False)
        for axis in axes.flat[len(budgets) :]:
            axis.set_axis_off()
        for axis, budget in zip(axes.flat, budgets, strict=False):
            _draw_waterfall(axis, budget, phase)
        for axis in axes[:, 0]:
            axis.set_ylabel(f"RMSE ({unit_of(budgets[0].task)})")
        # The upper panel of a column whose lower one is empty carries the names.
        for axis in axes.flat[len(budgets) - columns : len(budgets)]:
            axis.tick_params(axis="x", labelbottom=True, rotation=90)
        lower.suptitle("RMSE as causes are taken away, one after the other", fontsize=10.5)
        handles: list[object] = [
            Patch(color=COLORS[cause], label=cause) for cause in budgets[0].causes
        ]
        handles += [
            Line2D([], [], label="measured by Serres", **_MEASURED),
            Line2D([], [], label="improved feed-forward, simulated", **_IMPROVED),
        ]
        legend_below(figure, handles, 6)
        return png(figure)


def _draw_shares(axis: Any, budgets: Sequence[Budget], phase: str) -> None:  # noqa: ANN401
    """Stacked bars: RMSE of the printed voltages, divided as the mean square is."""
    places = np.arange(len(budgets))
    above, below = np.zeros(len(budgets)), np.zeros(len(budgets))
    for cause in budgets[0].causes:
        # The mean square divided by the RMSE: shares of it add up to the RMSE, less the rest.
        height = np.array([b.share(cause, phase) / b.printed[phase] for b in budgets])
        bottom = np.where(height >= 0.0, above, below)
        axis.bar(places, height, 0.62, bottom, color=COLORS[cause])
        above, below = above + np.maximum(height, 0.0), below + np.minimum(height, 0.0)
    axis.plot(places, [b.measured[phase] for b in budgets], **_MEASURED)
    axis.plot(places, [b.improved[phase] for b in budgets], **_IMPROVED)
    axis.axhline(0.0, color="black", linewidth=0.9)
    axis.set_xticks(places, [f"{b.pressure_kpa:g} kPa" for b in budgets])
    axis.set_ylabel(f"RMSE ({unit_of(budgets[0].task)})")
    axis.set_title(
        f"{budgets[0].task}: simulated RMSE of the printed voltages by cause "
        "(mean over all orders; below 0: makes up for others)"
    )
    axis.grid(visible=False, axis="x")


def _draw_waterfall(axis: Any, budget: Budget, phase: str) -> None:  # noqa: ANN401
    """From the printed voltages to the improved feed-forward."""
    fall, causes = budget.waterfall(phase), budget.causes
    last = len(causes) + 1
    axis.bar(0, fall[0], 0.75, color=_GREY)
    for k, cause in enumerate(causes):
        axis.bar(k + 1, fall[k + 1] - fall[k], 0.75, fall[k], color=COLORS[cause])
    axis.bar(last, budget.improved[phase], 0.75, color=_IMPROVED["color"])
    axis.hlines(fall, np.arange(last) - 0.375, np.arange(last) + 1.375, "black", linewidth=0.6)
    axis.plot([0], [budget.measured[phase]], **_MEASURED)
    axis.set_xticks(range(last + 1), ["printed", *causes, "improved"])
    axis.set_title(f"{budget.pressure_kpa:g} kPa")
    axis.grid(visible=False, axis="x")
