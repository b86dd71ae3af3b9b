"""A run's document as tables of words, for the terminal and for the documentation."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.speed.rows import EVALUATIONS

Row = Mapping[str, Any]


@dataclass(frozen=True)
class SpeedTable:
    """One table.

    Attributes:
        name: short name, for the documentation's marks.
        title: what it shows.
        header: names of the columns.
        rows: cells.
        words: leading columns that hold words; the others hold numbers.
    """

    name: str
    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1


def speed_tables(document: Mapping[str, Any]) -> list[SpeedTable]:
    """The tables that have rows."""
    known = [row for row in document["rows"] if row["rounds"]]
    made = (
        _single(_of(known, "single", "plant")),
        _batches(_of(known, "batch")),
        _right_hand_sides(known),
        _arithmetic(known),
        _others(_of(known, "rollouts", "learning"), "training", "Training"),
        _times(_of(known, "start"), "start", "The first step"),
        _times(_of(known, "fits"), "fits", "Fits"),
        _ratios(document["ratios"]),
        _left_out(document["rows"]),
    )
    return [table for table in made if table.rows]


def rate(value: float) -> str:
    """A rate in three digits.

    >>> rate(1234567.0), rate(20000.0), rate(950.0), rate(0.066)
    ('1.23 M', '20.0 k', '950', '0.0660')
    """
    for factor, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= 0.9995 * factor:
            return three(value / factor) + letter
    return three(value)


def three(value: float) -> str:
    """A positive number in three digits, without an exponent.

    >>> three(1000.0), three(99.96), three(1.8), three(0.0987654)
    ('1000', '100', '1.80', '0.0988')
    """
    if not value > 0.0:
        return f"{value:g}"
    # Of what three digits leave, for 99.96 has three before the point.
    digits = 2 - math.floor(math.log10(float(f"{value:.2e}")))
    return f"{value:.{max(0, digits)}f}"


def spread(row: Row) -> str:
    """Half of what lies between the quartiles, in percent of the median."""
    half = 0.5 * (row["upper_quartile"] - row["lower_quartile"])
    return f"{100.0 * half / row['median']:.0f} %"


def _of(rows: Iterable[Row], *groups: str) -> list[Row]:
    return [row for row in rows if row["group"] in groups]


def _single(rows: Sequence[Row]) -> SpeedTable:
    cells = []
    for row in rows:
        error = row["facts"].get("position_error")
        words = f"{row['step']}; position within {error:.0e}" if error else row["step"]
        cells.append([row["title"], words, rate(row["median"]), spread(row)])
    header = ["One environment", "One step", "Steps/s", "±"]
    return SpeedTable("single", "Steps per second of one environment", header, cells, words=2)


def _batches(rows: Sequence[Row]) -> SpeedTable:
    counts = sorted({row["number"] for row in rows})
    cells = []
    for title, own in _by_title(rows).items():
        at = {row["number"]: rate(row["median"]) for row in own}
        widest = max(own, key=lambda row: _relative(row))
        cells.append([title, *(at.get(count, "") for count in counts), spread(widest)])
    header = ["Environments", *map(str, counts), "±"]
    return SpeedTable("batches", "Steps per second of batches, all together", header, cells)


def _relative(row: Row) -> float:
    return (row["upper_quartile"] - row["lower_quartile"]) / row["median"]


def _right_hand_sides(rows: Sequence[Row]) -> SpeedTable:
    """Each contender's fastest row whose right-hand sides are known."""
    cells = []
    counted = [row for row in rows if row["right_hand_sides_per_step"]]
    for title, own in _by_title(counted).items():
        best = max(own, key=lambda row: row["median"])
        each = best["right_hand_sides_per_step"]
        number = str(best["number"] or 1)
        cells.append([title, number, f"{each:.4g}", rate(each * best["median"]), spread(best)])
    header = ["At its fastest", "Environments", "A step", "Right-hand sides/s", "±"]
    return SpeedTable("evaluations", "Evaluations of the right-hand side per second", header, cells)


_BATCH = "batch/own/1024"


def _arithmetic(rows: Sequence[Row]) -> SpeedTable:
    """What a control step computes, and how long a core takes for that if nothing else holds it up.

    Operations of the three sorts run beside each other, so the longest of their times is the least
    that a step can take.
    """
    cells: list[list[str]] = []
    own = next((row for row in rows if row["key"] == _BATCH), None)
    sorts = _of(rows, "core")
    if own and own["right_hand_sides_per_step"] and sorts:
        attempts = own["right_hand_sides_per_step"] / EVALUATIONS
        least = 0.0
        for row in sorts:
            number = row["facts"]["in_attempt"]
            duration = number * attempts / row["median"]
            least = max(least, duration)
            cells.append(
                [
                    row["title"],
                    f"{number}",
                    rate(number * attempts),
                    rate(row["median"]),
                    f"{1e9 * duration:.0f} ns",
                    "",
                ]
            )
        flops = sorts[0]["facts"]["flops"]
        step = 1.0 / own["median"]
        reached = f"{100.0 * least / step:.0f} % of the limit"
        numbers = [f"{flops}", rate(flops * attempts), rate(flops * attempts / step)]
        title = "floating-point operations, in the batch of 1024"
        cells.append([title, *numbers, f"{1e9 * step:.0f} ns", reached])
    header = ["One thread", "An attempt", "A control step", "Per second", "Time", "Reached"]
    return SpeedTable("arithmetic", "Arithmetic, and what one core can do", header, cells)


def _others(rows: Sequence[Row], name: str, title: str) -> SpeedTable:
    cells = [[row["title"], rate(row["median"]), spread(row)] for row in rows]
    return SpeedTable(name, title, ["What", "Steps/s", "±"], cells)


def _times(rows: Sequence[Row], name: str, title: str) -> SpeedTable:
    cells = [[row["title"], f"{1.0 / row['median']:.3g} s", spread(row)] for row in rows]
    return SpeedTable(name, title, ["What", "Time", "±"], cells)


def _ratios(ratios: Sequence[Row]) -> SpeedTable:
    cells = []
    for one in ratios:
        sign, unit = ("≤", " s") if one["at_most"] else ("≥", "" if one["ratio"] else " /s")
        limit = f"{sign} {one['limit']:g}{unit}"
        if one["median"] is None:
            cells.append([one["title"], limit, "", "", one["verdict"]])
            continue
        low, got, high = (rate(one[key]) for key in ("lower_quartile", "median", "upper_quartile"))
        cells.append([one["title"], limit, f"{got}{unit}", f"{low} to {high}", one["verdict"]])
    header = ["This package against", "Target", "This run", "Quartiles", "Verdict"]
    return SpeedTable("ratios", "Targets: median of the ratios within rounds", header, cells)


def _left_out(rows: Sequence[Row]) -> SpeedTable:
    """Reasons, each with what it left out, numbers of environments together."""
    reasons: dict[tuple[str, str], list[int]] = {}
    for row in rows:
        if row["left_out"]:
            why = f"failed: {row['left_out']}" if row["failed"] else row["left_out"]
            numbers = reasons.setdefault((row["title"], why), [])
            numbers += [row["number"]] if row["number"] else []
    cells = [[f"{title}{_listed(numbers)}", why] for (title, why), numbers in reasons.items()]
    return SpeedTable("absent", "Left out", ["What", "Why"], cells, words=2)


def _listed(numbers: Sequence[int]) -> str:
    return f" ({', '.join(map(str, numbers))})" if numbers else ""


def _by_title(rows: Iterable[Row]) -> dict[str, list[Row]]:
    grouped: dict[str, list[Row]] = {}
    for row in rows:
        grouped.setdefault(row["title"], []).append(row)
    return grouped


def sentences(document: Mapping[str, Any]) -> Iterator[str]:
    """Describe how the run was made."""
    run = document["run"]
    git = run["git"]
    changed = " with changes" if git["dirty"] else ""
    yield (
        f"{run['processor']}, {run['processors']} cores; commit {git['commit'][:12]}{changed}; "
        f"{run['started'][:10]}."
    )
    yield (
        f"{run['rounds']} rounds of {run['seconds']:g} s a row, {run['wall_time_s'] / 60:.0f} min "
        "in all; a figure is the median over the rounds, ± half of what lies between the quartiles."
    )
    for worker in document["workers"].values():
        versions = ", ".join(f"{name} {version}" for name, version in worker["versions"].items())
        yield f"{worker['title']}: {versions}."
