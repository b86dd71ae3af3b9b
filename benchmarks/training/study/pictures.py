"""Pictures of a study: learning curves against wall time."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette."""


def curves_picture(
    figures: Mapping[str, Any], policies: tuple[str, ...], lines: Mapping[str, Mapping[str, float]]
) -> bytes:
    """Learning curves: interquartile mean over the seeds and its interval, as PNG.

    Args:
        figures: of the study.
        policies: kinds and loops to draw, one panel each, such as `displacement-100hz`.
        lines: errors to compare with, by policy and name.
    """
    figure = Figure(figsize=(4.2 * len(policies), 3.4), layout="constrained")
    axes = figure.subplots(1, len(policies), squeeze=False)[0]
    for axis, policy in zip(axes, policies, strict=True):
        unit = ""
        drawn = [
            (group, group["trained"][f"{policy}-{group['algorithm']}"])
            for name, group in figures["groups"].items()
            if not name.startswith("ablation-")
            and f"{policy}-{group['algorithm']}" in group["trained"]
        ]
        for colour, (group, trained) in zip(COLOURS[: len(drawn)], drawn, strict=True):
            curve, unit = trained["curve"], trained["unit"]
            seeds = len(trained["seeds"])
            label = f"{group['title']}, {seeds} seed{'s' if seeds > 1 else ''}"
            axis.plot(curve["wall_s"], curve["error"], color=colour, label=label)
            axis.fill_between(
                curve["wall_s"], curve["low"], curve["high"], color=colour, alpha=0.25, linewidth=0
            )
        for name, error in lines.get(policy, {}).items():
            axis.axhline(error, color="#555555", linewidth=1.0, linestyle="--")
            axis.text(
                0.99,
                error,
                name,
                fontsize=8,
                ha="right",
                va="bottom",
                transform=axis.get_yaxis_transform(),
            )
        axis.set(
            yscale="log", xlabel="wall time (s)", ylabel=f"validation RMSE ({unit})", title=policy
        )
        axis.legend(fontsize=8)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=110)
    return content.getvalue()


def write_curves(figures: Mapping[str, Any], path: Path) -> None:
    """The learning curves of the tasks at 100 Hz beside the PID, as a PNG file."""
    policies = ("displacement-100hz", "rotation-100hz")
    lines = {name: {"PID": figures["pid"][name.partition("-")[0]]} for name in policies}
    path.write_bytes(curves_picture(figures, policies, lines))
