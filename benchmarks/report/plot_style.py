"""How all plots look: one colour and one marker for each controller, in every picture."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.suite import Suite

# Okabe and Ito's palette: told apart by the colour-blind, and in grey by the order of lightness.
_FIXED = {
    "serres_replay": ("#D55E00", "s"),
    "serres_feedforward": ("#CC79A7", "D"),
    "improved_feedforward": ("#E69F00", "^"),
    "pid": ("#0072B2", "v"),
    "feedforward_pid": ("#009E73", "o"),
    "policy": ("#56B4E9", "P"),
}
_OTHERS = (("#CC79A7", "D"), ("#56B4E9", "P"), ("#8C564B", "X"), ("#7F7F7F", "*"))

REFERENCE = {"color": "#000000", "linestyle": (0, (5, 3)), "linewidth": 1.1}
MEASURED = {"color": "#666666", "linewidth": 2.6, "alpha": 0.75}
BOUND = {"color": "#000000", "linestyle": (0, (1, 1.5)), "linewidth": 1.4}
DPI = 120

_RULES: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.labelsize": 9.5,
    "legend.fontsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.3,
    "figure.facecolor": "white",
}


@dataclass(frozen=True)
class Style:
    """How a controller is drawn.

    Attributes:
        label: in legends.
        color: of its lines, bars and markers.
        marker: of its points.
    """

    label: str
    color: str
    marker: str


def controller_styles(suite: Suite) -> dict[str, Style]:
    """A style for each controller of a suite, by name."""
    taken = {_FIXED[c.name][0] for c in suite.controllers if c.name in _FIXED}
    free = [other for other in _OTHERS if other[0] not in taken]
    styles = {}
    for controller in suite.controllers:
        strange = controller.name not in _FIXED
        color, marker = free[len(styles) % len(free)] if strange else _FIXED[controller.name]
        styles[controller.name] = Style(controller.label, color, marker)
    return styles


@contextmanager
def picture(width: float, height: float) -> Iterator[Figure]:
    """An empty figure (inches) in the house style; drawn without a screen."""
    with mpl.rc_context(_RULES):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def png(figure: Figure) -> bytes:
    """The figure as PNG; the same figure gives the same bytes."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=DPI, metadata={"Software": None})
    return out.getvalue()


def legend_below(figure: Figure, handles: Sequence[object], columns: int) -> None:
    """One legend for all panels, under them."""
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False)  # type: ignore[call-overload]
