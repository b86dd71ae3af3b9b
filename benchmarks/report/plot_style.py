"""How all plots look: one colour and one marker for each controller, in every picture."""

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.suite import Suite

Dashes = Literal["-", "--", "-.", ":"]

# Okabe and Ito's palette, told apart by the colour-blind and in grey by the order of lightness;
# then three of Tol's darker ones. Marker and line tell apart what a weak printer does not.
_FIXED: dict[str, tuple[str, str, Dashes]] = {
    "serres_replay": ("#D55E00", "s", "-"),
    "serres_feedforward": ("#CC79A7", "D", "-"),
    "improved_feedforward": ("#E69F00", "^", "-"),
    "pid": ("#0072B2", "v", "-"),
    "feedforward_pid": ("#009E73", "o", "-"),
    "lqg": ("#882255", "<", "--"),
    "adrc": ("#999933", "X", "--"),
    "sliding_mode": ("#CC79A7", "h", "--"),
    "mpc": ("#332288", "p", "--"),
    "ilc": ("#D55E00", "d", "--"),
    "oracle": ("#000000", "*", ":"),
    "policy": ("#56B4E9", "P", "-"),
}
_OTHERS: tuple[tuple[str, str, Dashes], ...] = (
    ("#CC79A7", "D", "-."),
    ("#56B4E9", "P", "-."),
    ("#8C564B", "X", "-."),
    ("#7F7F7F", "*", "-."),
)

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
        line: dashes of its lines, where many are drawn in one panel.
    """

    label: str
    color: str
    marker: str
    line: Dashes = "-"


def controller_styles(suite: Suite) -> dict[str, Style]:
    """A style for each controller of a suite, by name."""
    return styles_of({controller.name: controller.label for controller in suite.controllers})


def styles_of(labels: Mapping[str, str]) -> dict[str, Style]:
    """A style for each controller of a report.

    Args:
        labels: what people call the controllers, by name.
    Returns:
        Its own for one that the package has, one of the free ones for another, by name.
    """
    taken = {_FIXED[name][0] for name in labels if name in _FIXED}
    free = [other for other in _OTHERS if other[0] not in taken]
    styles = {}
    for name, label in labels.items():
        own = _FIXED[name] if name in _FIXED else free[len(styles) % len(free)]
        styles[name] = Style(label, *own)
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
