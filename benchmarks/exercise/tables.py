"""The exercise device's figures as tables, for the terminal and the report."""

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from pma_gym.pages.document import TextTable
from pma_gym.plant.exercise_device.device import Device, own_device, resistive_moment
from pma_gym.plant.exercise_device.knee import knee_extension_torque
from pma_gym.plant.model import Model
from pma_gym.studies.moment_ranges import (
    Span,
    check_moments,
    lowest_rest_pressure,
    makers_figures,
    span,
)
from pma_gym.units import SI_FACTORS

_DEG = SI_FACTORS["deg"]
NONE = "—"
_SHORT = 18
"""Characters up to which a cell of the terminal stays on one line."""

SCHEDULED_DEG = (0, 45, 90)
"""Angles at which the moments of a cable set once are shown."""


def check_table(model: Model) -> TextTable:
    """The tested muscle at 90 deg: ours, table I3's and table 23's, and the knee there."""
    knee = float(knee_extension_torque(90.0 * _DEG))
    rows = [
        [
            f"{1e-3 * check.pressure:g}",
            f"{check.ours:.2f}",
            f"{check.measured:.2f}",
            f"{check.percent:+.2f}",
            f"{check.printed:.2f}",
            f"{100.0 * check.ours / knee:.0f}",
        ]
        for check in check_moments(model)
    ]
    return TextTable(
        "Tested muscle: moment (N m) at 90 deg",
        [
            "Pressure (kPa)",
            "Model",
            "Table I3",
            "Difference (%)",
            "Table 23",
            "% of the knee",
        ],
        rows,
    )


def range_table(model: Model, devices: Sequence[Device]) -> TextTable:
    """Moments of every configuration at constant and at scheduled pressure."""
    header = [
        "Configuration",
        "Standing",
        "Constant | kPa",
        "Constant | 90 deg",
        "Set once | kPa",
        *(f"Set once | {angle} deg" for angle in SCHEDULED_DEG),
    ]
    rows = [_range_row(model, device) for device in devices]
    return TextTable(
        "Range of moments (N m); scaled: extrapolated from the tested muscle", header, rows, words=2
    )


def _range_row(model: Model, device: Device) -> list[str]:
    number, diameter, length = device.muscles
    constant, rest = span(model, device), lowest_rest_pressure(model, device)
    cells = [
        f"{number}x{1e3 * diameter:g}x{1e3 * length:g}, {1e3 * device.radius:.4g}",
        "scaled" if device.muscles.extrapolated else "tested",
        *(_pressures(constant), _moments(constant), f"{1e-3 * rest:.0f}" if rest else NONE),
    ]
    for angle in SCHEDULED_DEG:
        cells.append(_moments(span(model, device, angle * _DEG, rest) if rest else None))
    return cells


def _pressures(span: Span | None) -> str:
    return f"{1e-3 * span.lowest:.0f}–{1e-3 * span.highest:.0f}" if span else NONE


def _moments(span: Span | None) -> str:
    if span is None:
        return NONE
    digits = 1 if span.high < 49.95 else 0
    return f"{span.low:.{digits}f}–{span.high:.{digits}f}"


def knee_table(model: Model) -> TextTable:
    """The knee's torque over angle beside the tested muscle's moment."""
    device = own_device(model)
    angles = np.arange(0, 91, 15)
    low, high = (
        resistive_moment(model, device, 1e3 * pressure, _DEG * angles).moment
        for pressure in (275.0, 575.0)
    )
    knee = knee_extension_torque(_DEG * angles)
    rows = [
        [f"{a}", f"{90 - a}", f"{k:.0f}", f"{lo:.1f}", f"{hi:.1f}", f"{100 * hi / k:.0f}"]
        for a, k, lo, hi in zip(angles, knee, low, high, strict=True)
    ]
    return TextTable(
        "A young adult's knee beside the tested muscle (N m)",
        [
            "Angle (deg)",
            "Flexion (deg)",
            "Knee",
            "Tested muscle | 275 kPa",
            "Tested muscle | 575 kPa",
            "Tested muscle | % of knee",
        ],
        rows,
    )


def makers_table(model: Model) -> TextTable:
    """Makers' figures beside the scaled ones."""
    rows = [
        [figure.what, figure.source]
        + [f"{figure.maker:.4g}", f"{figure.ours:.4g}", f"{figure.percent:+.0f}"]
        for figure in makers_figures(model)
    ]
    return TextTable(
        "Makers' figures at 600 kPa beside the scaled ones",
        ["Figure", "Source", "Maker", "Scaled", "%"],
        rows,
        words=2,
    )


def terminal_table(table: TextTable) -> Table:
    """A table of the report for the terminal, as narrow as 80 columns."""
    shown = Table(title=table.title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for column, name in enumerate(table.header):
        justify = "left" if column < table.words else "right"
        short = max(len(row[column]) for row in table.rows) <= _SHORT
        shown.add_column(name.replace(" | ", "\n"), justify=justify, no_wrap=short)
    for row in table.rows:
        shown.add_row(*row)
    return shown
