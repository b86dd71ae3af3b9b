"""Targets of a suite for its controllers, as in its file."""

from collections.abc import Mapping
from typing import Any, NamedTuple

FIGURES = {
    "largest": "largest mean error of a controller at any pressure (mm or deg)",
    "above_bound": "the same, above the achievable bound (mm or deg)",
    "best": "least interquartile mean of any controller (mm or deg)",
    "best_to_bound": "the best controller's interquartile mean over the oracle's",
    "to_bound": "a controller's interquartile mean over the oracle's",
    "to_other": "the first controller's interquartile mean over the second's",
    "half_width": "widest half interval of an interquartile mean (% of it)",
    "ratio_half_width": "widest half interval of a ratio to the best, up to twice it (% of it)",
}
"""Figures that a target may speak of."""

PER_CONTROLLER = ("largest", "above_bound", "to_bound", "to_other")
"""Figures of the controllers that the target names; the others are of all rivals."""


class Target(NamedTuple):
    """A figure and the most that it may be.

    Attributes:
        figure: one of `FIGURES`.
        measure: name of the measure, see `benchmarks.report.errors.measures`.
        most: limit, in the figure's unit; None for a figure that is only told.
        controllers: names of those that it speaks of.
    """

    figure: str
    measure: str
    most: float | None
    controllers: tuple[str, ...] = ()


def parse_target(given: Mapping[str, Any]) -> Target:
    """A target from a suite's file, its table `[[targets]]`.

    Raises:
        ValueError: an unknown figure or key, or controllers where none or some are needed.
    """
    unknown = set(given) - set(Target._fields)
    if unknown:
        raise ValueError(f"targets: unknown {', '.join(sorted(unknown))}; known: {Target._fields}")
    figure, controllers = given["figure"], tuple(given.get("controllers", ()))
    if figure not in FIGURES:
        raise ValueError(f"targets: figure must be one of {', '.join(FIGURES)}, got {figure!r}")
    if bool(controllers) != (figure in PER_CONTROLLER):
        rule = "must name" if figure in PER_CONTROLLER else "speaks of all and must not name"
        raise ValueError(f"targets: {figure} {rule} controllers, got {list(controllers)}")
    if figure == "to_other" and len(controllers) != 2:
        raise ValueError(f"targets: to_other compares two controllers, got {list(controllers)}")
    most = given.get("most")
    return Target(figure, given["measure"], None if most is None else float(most), controllers)
