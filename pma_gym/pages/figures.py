"""Plots, drawn without a screen, the same bytes every time; and how notebooks show objects."""

import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.registry import BackendFilter, backend_registry
from matplotlib.figure import Figure

from pma_gym.documents import printable
from pma_gym.pages.document import DPI, Block, html_block

# Colours come from the notebook, so that they fit its light and its dark theme.
_STYLE = """<style>
.pma-gym { max-width: 60rem; }
.pma-gym .callout { border-left: 5px solid #0072b2; padding: .2rem 0 .2rem .9rem; margin: .4rem 0; }
.pma-gym .callout.good { border-color: #009e73; }
.pma-gym .callout.bad { border-color: #d55e00; }
.pma-gym .callout .large { font-weight: 600; }
.pma-gym .wide { overflow-x: auto; }
.pma-gym caption { text-align: left; font-weight: 600; caption-side: top; color: inherit; }
.pma-gym tbody th { text-align: left; font-weight: 400; }
.pma-gym figure { margin: .4rem 0; }
.pma-gym img { max-width: 100%; height: auto; background: #fff; }
</style>"""


def notebook_html(blocks: Sequence[Block], pictures: Mapping[str, bytes] | None = None) -> str:
    """Render blocks as the HTML that `_repr_html_` returns.

    Args:
        blocks: what is shown.
        pictures: PNG by name; one that is missing is left out.
    """
    body = "\n".join(html_block(block, pictures or {}) for block in blocks)
    return f'{_STYLE}\n<div class="pma-gym">\n{printable(body)}\n</div>'


_WITHOUT_WINDOW = BackendFilter.NON_INTERACTIVE

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
    # Names and titles are data: a dollar sign in one is no formula.
    "text.parse_math": False,
    "svg.hashsalt": "pma-gym",
}


class Plot(Figure):
    """A figure that notebooks show, `savefig` writes and `show` opens in a window.

    No list of open figures keeps it: many may be drawn without closing any.
    """

    def _repr_png_(self) -> bytes:
        """Return the PNG that a notebook shows."""
        return png(self)

    def show(self, warn: bool = True) -> None:
        """Open the figure in a window and wait until it is closed.

        Args:
            warn: say that there is no screen, where there is none; Matplotlib's argument.
        """
        from matplotlib import pyplot

        if pyplot.get_backend().lower() in backend_registry.list_builtin(_WITHOUT_WINDOW):
            if warn:
                warnings.warn(
                    f"Matplotlib's backend {pyplot.get_backend()} opens no window; write the "
                    "figure with savefig('figure.png'), or set MPLBACKEND to one that does: QtAgg",
                    stacklevel=2,
                )
            return
        # Matplotlib makes a window only for a figure that it makes itself: it is given this one.
        pyplot.figure(FigureClass=lambda *_, **__: self)  # type: ignore[arg-type]
        pyplot.show()


@contextmanager
def picture(width: float, height: float) -> Iterator[Plot]:
    """Create an empty figure (inches) in the project's style, without a screen."""
    with mpl.rc_context(_RULES):
        figure = Plot(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""What each form would say that another day has otherwise."""


def rendered(figure: Figure, form: str) -> bytes:
    """Render the figure as `png`, `svg` or `pdf`; the same figure gives the same bytes."""
    out = io.BytesIO()
    with mpl.rc_context(_RULES):
        figure.savefig(out, format=form, dpi=DPI, metadata=_METADATA[form])
    return out.getvalue()


def png(figure: Figure) -> bytes:
    """Render the figure as PNG; the same figure gives the same bytes."""
    return rendered(figure, "png")


def picture_files(figures: Mapping[str, Figure], vector: bool) -> dict[str, bytes]:
    """Render figures as PNG, if wanted as SVG and PDF too.

    Returns:
        Contents by name of file.
    """
    forms = _METADATA if vector else ("png",)
    return {
        f"{name}.{form}": rendered(each, form) for name, each in figures.items() for form in forms
    }


def pngs(files: Mapping[str, bytes]) -> dict[str, bytes]:
    """The PNGs among files, by the names of their figures."""
    suffix = ".png"
    return {n.removesuffix(suffix): content for n, content in files.items() if n.endswith(suffix)}


def legend_below(figure: Figure, handles: Sequence[object], columns: int) -> None:
    """Draw one legend under all panels, in fewer columns where the figure is too narrow.

    Args:
        figure: drawn by Agg.
        handles: of the entries.
        columns: the most that there are.
    """
    place: dict[str, Any] = {"loc": "outside lower center", "frameon": False}
    for ncols in range(columns, 0, -1):
        legend = figure.legend(handles=handles, ncols=ncols, **place)
        if ncols == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()
