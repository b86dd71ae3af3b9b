"""The exercise device's figures as tables, for the terminal and the report.

The exercise device's picture: moments against pressure, and over angle beside the knee.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks.exercise.profile import Answer
from pma_gym.pages.document import TextTable
from pma_gym.pages.figures import picture, png
from pma_gym.plant.exercise_device.device import (
    FULL_ANGLE,
    Device,
    own_device,
    pressure_grid,
    resistive_moment,
)
from pma_gym.plant.exercise_device.knee import dissertations_knee_peak, knee_extension_torque
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


_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES = ("-", "--", "-.", ":")


def exercise_plot(model: Model, devices: Sequence[Device], answer: Answer | None) -> bytes:
    """Both panels as PNG.

    Args:
        model: of the station.
        devices: whose moments are drawn.
        answer: a prescription's answer, or None.
    """
    with picture(13.0, 6.2) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
        _draw_pressures(left, model, devices)
        _draw_angles(right, model, answer)
        return png(figure)


def _draw_pressures(axis: Axes, model: Model, devices: Sequence[Device]) -> None:
    """Moment at 90 deg against constant pressure, with table I3's points and table 23's."""
    pressure = pressure_grid(model)
    diameters = sorted({device.muscles.diameter for device in devices})
    counts = sorted({device.muscles.number for device in devices})
    for device in devices:
        moments = resistive_moment(model, device, pressure, FULL_ANGLE)
        number, diameter, _ = device.muscles
        color = _COLORS[diameters.index(diameter) % len(_COLORS)]
        line = _DASHES[counts.index(number) % len(_DASHES)]
        moment = np.where(moments.allowed, moments.moment, np.nan)
        axis.plot(1e-3 * pressure, moment, color=color, linestyle=line)
        _label_end(axis, device, moment, color)
    checks = check_moments(model)
    at = [1e-3 * check.pressure for check in checks]
    measured = [check.measured for check in checks]
    axis.plot(at, measured, "ko", markersize=4, label="table I3: load cell x radius")
    printed = [check.printed for check in checks]
    axis.plot(at, printed, "x", color="#666666", label="table 23 (does not follow from I3)")
    knee = float(knee_extension_torque(FULL_ANGLE))
    axis.axhline(knee, color="#666666", linewidth=0.9, linestyle=":")
    axis.text(152, knee * 1.03, "knee at this angle", color="#444444", fontsize=8.5)
    axis.set(yscale="log", xlabel="pressure (kPa)", ylabel="moment at 90 deg (N m)")
    axis.set(xlim=(150, 690), xticks=range(150, 601, 50))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_major_formatter("{x:g}")
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.set_title("At constant pressure, 90 deg: by configuration")
    axis.legend(loc="upper left", frameon=False)


def _label_end(axis: Axes, device: Device, moment: np.ndarray, color: str) -> None:
    """A configuration's name at the right end of its line."""
    if np.isfinite(moment[-1]):
        number, diameter, length = device.muscles
        axis.annotate(
            f"{number} x {1e3 * diameter:g} x {1e3 * length:g} mm",
            (575, moment[-1]),
            (4, -3),
            textcoords="offset points",
            color=color,
        )


def _draw_angles(axis: Axes, model: Model, answer: Answer | None) -> None:
    """Moment over angle: the knee, the tested muscle, and the prescription on its device."""
    angle = _DEG * np.linspace(0.0, 90.0, 91)
    degrees = angle / _DEG
    axis.plot(degrees, knee_extension_torque(angle), color="black", label="knee, Anderson 2007")
    peak = dissertations_knee_peak()
    axis.axhline(peak, color="#666666", linestyle=":", label="largest of the knee, Serres 2008")
    own = own_device(model)
    _draw_band(axis, model, own, None, "#0072B2", "tested muscle, cable set once")
    for pressure, line in ((275e3, "--"), (575e3, "-")):
        moment = resistive_moment(model, own, pressure, angle).moment
        axis.plot(
            degrees,
            moment,
            color="#0072B2",
            linestyle=line,
            label=f"tested muscle, constant {1e-3 * pressure:g} kPa",
        )
    if answer is not None:
        _draw_answer(axis, model, answer)
    axis.set(xlabel="angle (deg), 90 = straight leg", ylabel="moment (N m)", xlim=(0, 90))
    axis.set(
        ylim=(0.0, 1.4 * axis.get_ylim()[1]), title="Over the angle, beside a young adult's knee"
    )
    axis.legend(loc="upper left", ncols=2, frameon=False, fontsize=8.5)


def _draw_answer(axis: Axes, model: Model, answer: Answer) -> None:
    degrees = answer.prescription.angle / _DEG
    label = f"smallest: {answer.device}".replace(" on a pulley", "\non a pulley")
    if answer.prescription.scheduled:
        _draw_band(axis, model, answer.device, answer.setting, "#D55E00", label)
        axis.plot(
            degrees, answer.prescription.moment, color="#D55E00", marker=".", label="prescription"
        )
        return
    angle = _DEG * np.linspace(0.0, 90.0, 91)
    moment = resistive_moment(model, answer.device, answer.setting[0], angle).moment
    axis.plot(angle / _DEG, moment, color="#D55E00", label=label)
    axis.plot(degrees, answer.prescription.moment, "o", color="#D55E00", label="prescription")


def _draw_band(
    axis: Axes, model: Model, device: Device, setting: object, color: str, label: str
) -> None:
    """Between the moments of the lowest and the highest allowed pressure."""
    rest = getattr(setting, "rest_pressure", None) or lowest_rest_pressure(model, device)
    if rest is None:
        return
    angle = _DEG * np.linspace(0.0, 90.0, 46)
    swept = resistive_moment(model, device, pressure_grid(model, 12.5e3), angle[:, None], rest)
    some = swept.allowed.any(axis=1)
    low, high = (
        edge(swept.moment[some], axis=1, where=swept.allowed[some], initial=worst)
        for edge, worst in ((np.min, np.inf), (np.max, -np.inf))
    )
    axis.fill_between(
        angle[some] / _DEG, low, high, color=color, alpha=0.15, linewidth=0, label=label
    )
