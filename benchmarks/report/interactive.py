"""The leaderboard's figures to zoom, hover and filter: every case of every controller."""

from collections.abc import Mapping, Sequence

from benchmarks.report.plot_style import Style
from benchmarks.report.standings import Standings
from benchmarks.report.tables import capital
from pma_gym.pages.interactive import InteractiveFigure, Trace

MOST_POINTS = 40_000
"""Points of all figures together, so that a page stays below 5 MB."""


def case_figures(
    every: Sequence[Standings], styles: Mapping[str, Style]
) -> list[InteractiveFigure]:
    """Errors of all cases by pressure, a figure a measure, until there are too many points.

    Args:
        every: standings in the measures.
        styles: of the controllers, by name.
    """
    figures, points = [], 0
    for standings in every:
        points += standings.errors.values.size
        if points > MOST_POINTS:
            break
        figures.append(_figure(standings, styles))
    return figures


def _figure(standings: Standings, styles: Mapping[str, Style]) -> InteractiveFigure:
    errors = standings.errors
    title = capital(errors.measure.name)
    notes = [f"{episode.task}, station {episode.station}" for episode in errors.episodes]
    pressures = [episode.pressure_kpa for episode in errors.episodes]
    traces = [
        Trace(
            styles[name].label, pressures, list(errors.of(name)), styles[name].color, False, notes
        )
        for name in errors.names
    ]
    caption = (
        f"{title}: every case. Hover for its station; click a controller to hide it, double-click "
        "to see it alone; drag to zoom, double-click to zoom out."
    )
    name = "cases-" + "-".join(errors.measure.name.split())
    label = f"RMSE ({errors.measure.unit})"
    return InteractiveFigure(name, caption, "pressure (kPa)", label, traces, logarithmic=True)
