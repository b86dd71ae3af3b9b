"""Columns of trial files, sensor calibrations, the dissertation's tables."""

from importlib import resources

from generators.text import code, number, table
from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_columns import COLUMNS, RAW_COLUMNS
from pma_gym.units import SI_FACTORS

_TIME = "since the start; required, strictly increasing"


def _meaning(quantity: str) -> str:
    """What a column holds, in words."""
    return SIGNALS[quantity].meaning if quantity in SIGNALS else _TIME


def columns() -> str:
    """The columns of a trial's file."""
    rows = [
        [
            code(column.name),
            column.unit,
            column.kind,
            _meaning(column.quantity),
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
