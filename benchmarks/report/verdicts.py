"""Verdicts on a run by its suite's targets."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.report.standings import Standing, Standings
from benchmarks.report.statistics import Interval
from benchmarks.suites.suite import FIGURES, Target

UNITS = {
    "half_width": "%",
    "ratio_half_width": "%",
    "best_to_bound": "",
    "to_bound": "",
    "to_other": "",
}
"""Units of figures that have not their measure's."""

NEAR = 2.0
"""Ratio to the best up to which a controller is near enough that its ratio must be sure."""

Bound = Callable[[str, float], float]
"""Least RMSE that can be reached in phase III (mm or deg), by task and pressure (kPa)."""


class Verdict(NamedTuple):
    """A target and what was got.

    Attributes:
        what: in words.
        most: the limit; None if there is none.
        got: the figure; None if it was not measured.
        unit: of both; empty for a ratio.
    """

    what: str
    most: float | None
    got: Interval | None
    unit: str = ""

    @property
    def word(self) -> str:
        """`met`, `missed`, `no figure`, or a dash where nothing is asked."""
        if self.got is None:
            return "no figure"
        if self.most is None:
            return "—"
        return "met" if self.got.estimate <= self.most else "missed"

    def document(self) -> dict[str, object]:
        """The target for programs."""
        got = None if self.got is None else float(self.got.estimate)
        return {"target": self.what, "limit": self.most, "got": got, "verdict": self.word}


def verdicts(
    targets: tuple[Target, ...],
    standings: Mapping[str, Standings],
    labels: Mapping[str, str],
    units: Mapping[str, str],
    bound: Bound,
) -> list[Verdict]:
    """Every target of a suite.

    Args:
        targets: the suite's.
        standings: of the measures that all cases have been run for, by name.
        labels: what people call the controllers.
        units: of the measures, by name.
        bound: the achievable bound.
    """
    results = []
    for target in targets:
        known = standings.get(target.measure)
        if target.figure == "to_other":
            those = [_of_two(target, known, labels)]
        elif target.controllers:
            those = [_of_one(target, known, name, labels, bound) for name in target.controllers]
        else:
            those = [_of_all(target, known, labels)]
        unit = UNITS.get(target.figure, units.get(target.measure, ""))
        results += [verdict._replace(unit=unit) for verdict in those]
    return results


def _of_one(
    target: Target,
    standings: Standings | None,
    name: str,
    labels: Mapping[str, str],
    bound: Bound,
) -> Verdict:
    """A target of one controller."""
    meanings = {
        "largest": "largest mean error at a pressure",
        "above_bound": "largest mean error above the achievable bound",
        "to_bound": "interquartile mean over the oracle's",
    }
    what = f"{labels.get(name, name)}, {target.measure}: {meanings[target.figure]}"
    if standings is None or name not in standings.errors.names:
        return Verdict(what, target.most, None)
    if target.figure == "to_bound":
        row = next(row for row in standings.rows if row.name == name)
        return Verdict(what, target.most, row.to_bound)
    means = mean_by_trial(standings, name)
    largest = max(means.values())
    if target.figure == "above_bound":
        largest = largest_excess(means, bound)
    return Verdict(what, target.most, Interval(largest, np.nan, np.nan))


def largest_excess(means: Mapping[tuple[str, float], float], bound: Bound) -> float:
    """The largest of the mean errors less their bounds, with as few bounds as are needed.

    No bound is less than 0, so that a mean error that does not exceed an excess already known
    cannot have a larger one. A bound takes seconds to compute.

    >>> largest_excess({("rotation", 300.0): 0.3, ("rotation", 500.0): 0.2}, lambda *trial: 0.0625)
    0.2375
    """
    largest = -np.inf
    for trial, mean in sorted(means.items(), key=lambda item: -item[1]):
        if mean <= largest:
            break
        largest = max(largest, mean - bound(*trial))
    return largest


def _of_two(target: Target, standings: Standings | None, labels: Mapping[str, str]) -> Verdict:
    """A target of one controller beside another."""
    first, second = target.controllers
    said = labels.get(first, first), labels.get(second, second)
    what = f"{said[0]}, {target.measure}: interquartile mean over that of {said[1]}"
    if standings is None or not {first, second} <= set(standings.errors.names):
        return Verdict(what, target.most, None)
    places = (standings.errors.names.index(name) for name in (first, second))
    return Verdict(what, target.most, standings.ratio(*places))


def _of_all(target: Target, standings: Standings | None, labels: Mapping[str, str]) -> Verdict:
    """A target of all rivals together."""
    what = f"{target.measure}: {FIGURES[target.figure].partition(' (')[0]}"
    if standings is None or standings.best is None:
        return Verdict(what, target.most, None)
    rivals = [row for row in standings.rows if row.rank is not None]
    best = rivals[0]
    if target.figure in ("half_width", "ratio_half_width"):
        return _widest(target, standings, rivals, what, labels)
    what = f"{what}: {labels.get(best.name, best.name)}"
    if target.figure == "best":
        return Verdict(what, target.most, best.mean)
    return Verdict(what, target.most, best.to_bound)


def _widest(
    target: Target,
    standings: Standings,
    rivals: Sequence[Standing],
    what: str,
    labels: Mapping[str, str],
) -> Verdict:
    """The least sure of the rivals' figures, as a share of itself; a ratio of its pair alone."""
    at, best = standings.errors.names.index, rivals[0].name

    def width(row: Standing) -> float:
        if target.figure == "half_width":
            return row.mean.half_width
        ratio = standings.ratio(at(row.name), at(best))
        return ratio.half_width if ratio.estimate <= NEAR else 0.0

    widest = max(rivals, key=width)
    got = Interval(100.0 * width(widest), np.nan, np.nan)
    return Verdict(f"{what}: {labels.get(widest.name, widest.name)}", target.most, got)


def mean_by_trial(standings: Standings, name: str) -> dict[tuple[str, float], float]:
    """A controller's mean error (the measure's unit) by task and pressure (kPa)."""
    by_trial: dict[tuple[str, float], list[float]] = {}
    values = standings.errors.of(name)
    for episode, value in zip(standings.errors.episodes, values, strict=True):
        by_trial.setdefault((episode.task, episode.pressure_kpa), []).append(float(value))
    return {trial: float(np.mean(errors)) for trial, errors in by_trial.items()}
