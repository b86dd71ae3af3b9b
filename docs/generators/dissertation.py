"""The dissertation's tables and what is wrong in them; columns and calibrations of trial files."""

import math
from collections import Counter
from functools import cache
from importlib import resources

from benchmarks.dissertation import counts_table
from generators.text import code, number, table
from pma_gym.data.serres2008 import corrections, pressures
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_columns import COLUMNS, RAW_COLUMNS
from pma_gym.studies import Comparison, compare_all
from pma_gym.studies.voltage_profile import profile_model
from pma_gym.units import SI_FACTORS


def misprints() -> str:
    """Every corrected cell; table I3's change of unit on one line."""
    by_place = corrections()
    reasons = Counter(item.reason for item in by_place)
    single = [item for item in by_place if reasons[item.reason] < 10]
    rows = [
        [
            item.table,
            item.where.replace("_", " "),
            item.column.replace("_", " "),
            item.printed,
            "lost" if math.isnan(item.corrected) else number(item.corrected),
            item.reason,
        ]
        for item in single
    ]
    text = table(["Table", "Row", "Column", "Printed", "Used", "Why"], rows, right=(3, 4))
    shifted = [f"{count} cells {reason}" for reason, count in reasons.items() if count >= 10]
    return text + "\n\n" + f"In table I3, {'; '.join(shifted)}. They are read as percent."


def verdicts() -> str:
    """Tabulate figures of each study that are equal, rounded and misprinted."""
    counts = counts_table(_compared())
    return table(counts.header, counts.rows, right=(1, 2, 3))


def wrong_in_print() -> str:
    """Every figure that does not follow from the printed data."""
    rows = [
        [row.table, row.quantity.replace("_", " "), row.printed, number(row.recomputed), row.note]
        for row in _compared()
        if row.verdict == "wrong in print"
    ]
    return table(["Table", "Figure", "Printed", "Recomputed", "From"], rows, right=(2, 3))


def rates() -> str:
    """Rates of the muscle that the printed voltage profiles were computed with."""
    known = sorted({*pressures("displacement"), *pressures("rotation")})
    header = ["Pressure (kPa)", *map(str, known)]
    cells = [f"{profile_model(pressure).muscle_rate:.2f}" for pressure in known]
    return table(header, [["A (1/s)", *cells]], right=range(1, len(header)))


@cache
def _compared() -> tuple[Comparison, ...]:
    return tuple(compare_all())


_TIME = "since the start; required, strictly increasing"


def columns() -> str:
    """The columns of a trial's file."""
    rows = [
        [
            code(column.name),
            column.unit,
            column.kind,
            SIGNALS[column.quantity].meaning if column.quantity in SIGNALS else _TIME,
            "" if column.limits is None else f"{column.limits[0]:g} to {column.limits[1]:g}",
        ]
        for column in COLUMNS
    ]
    return table(["Column", "Unit", "Kind", "What", "Limits"], rows)


def raw_columns() -> str:
    """Raw sensor voltages that a file may hold instead."""
    rows = [[code(column.name), f"{column.quantity}"] for column in RAW_COLUMNS]
    return table(["Column", "In place of"], rows)


def calibrations() -> str:
    """Lines of table 1, and what a step of the DAQ is worth."""
    units = {column.quantity: column.unit for column in COLUMNS}
    rows = []
    for column in RAW_COLUMNS:
        line, unit = column.calibration, units[column.quantity]
        assert line is not None
        factor = SI_FACTORS[unit]
        gain, offset = number(line.gain * factor), number(line.offset)
        rows.append([column.quantity, f"{gain} V/{unit}", f"{offset} V", _step(line, unit, factor)])
    return table(["Sensor", "Gain", "Offset", "One step of the DAQ"], rows, right=(1, 2, 3))


def tables() -> str:
    """The shipped tables of the dissertation, as their own README lists them."""
    text = resources.files("pma_gym.data.serres2008").joinpath("README.md").read_text("utf-8")
    return text.partition("\n\n")[2]


def _step(line, unit: str, factor: float) -> str:  # noqa: ANN001 - a Calibration
    return f"{line.resolution / factor:.3g} {unit}"
