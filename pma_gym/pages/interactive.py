"""Interactive figures (zoom, hover, filter), drawn by the browser without a network.

`plotly-basic.min.js` is plotly.js 4.1.1 (basic bundle, MIT licence beside it), from npm's package
`plotly.js-basic-dist-min`; a page holds it once, however many figures it has.
"""

import html
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pma_gym.documents import printable

_HERE = Path(__file__).parent
_MARKED = 30


@dataclass(frozen=True)
class Trace:
    """A curve or a cloud of points.

    Attributes:
        name: in the legend, where a click hides it and a double click hides all others.
        x: of the points.
        y: of the points; NaN leaves a gap.
        color: `#rrggbb`; empty for the colour of text.
        lines: whether points are joined.
        notes: what hovering shows beside the coordinates, a text a point; none if empty.
        view: the view of the figure that shows it, which is also the label of its y axis, with
            unit; empty for a trace that every view shows.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]
    color: str = ""
    lines: bool = True
    notes: Sequence[str] = ()
    view: str = ""


@dataclass(frozen=True)
class InteractiveFigure:
    """A figure of the HTML page only; print and Markdown have pictures.

    Traces with different views make the figure one with a menu: the reader picks what it shows.

    Attributes:
        name: of the figure on its page.
        caption: below it.
        x_label: of the axis, with unit.
        y_label: of the axis, with unit; unused where traces have views.
        traces: what is drawn.
        logarithmic: whether the y axis is.
    """

    name: str
    caption: str
    x_label: str
    y_label: str
    traces: Sequence[Trace]
    logarithmic: bool = False


def scripts(figures: Sequence[InteractiveFigure]) -> str:
    """Return the scripts of a page's head: library, figures as data, drawing code.

    Empty where there are none.
    """
    if not figures:
        return ""
    library = (_HERE / "plotly-basic.min.js").read_text(encoding="utf-8")
    draw = (_HERE / "interactive.js").read_text(encoding="utf-8")
    # No name in the data can end the script: `<` is written as its escape.
    data = json.dumps([_document(each) for each in figures], allow_nan=False)
    data = data.replace("<", "\\u003c")
    return (
        f"<script>{library}</script>\n"
        f'<script type="application/json" id="figures">{data}</script>\n'
        f"<script>{draw}</script>"
    )


def _document(figure: InteractiveFigure) -> dict[str, Any]:
    return {
        "name": figure.name,
        "x": _safe(figure.x_label),
        "y": _safe(figure.y_label),
        "logarithmic": figure.logarithmic,
        "views": [
            _safe(view) for view in dict.fromkeys(each.view for each in figure.traces) if view
        ],
        "traces": [
            {
                "name": _safe(trace.name),
                "x": [_number(value) for value in trace.x],
                "y": [_number(value) for value in trace.y],
                "color": trace.color,
                "mode": _mode(trace),
                "view": _safe(trace.view),
                "notes": [_safe(note) for note in trace.notes],
            }
            for trace in figure.traces
        ],
    }


def _mode(trace: Trace) -> str:
    """What is drawn; a line of few points marks them, to be hovered over."""
    if not trace.lines:
        return "markers"
    return "lines+markers" if len(trace.x) <= _MARKED else "lines"


def _safe(text: str) -> str:
    """Text that the library shows as it is: it would read some tags."""
    return html.escape(printable(text))


def _number(value: float) -> float | None:
    """Six digits are more than a screen has."""
    return float(f"{value:.6g}") if math.isfinite(value) else None
