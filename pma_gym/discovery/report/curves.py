"""The worst trial drawn: measured against simulated, before and after, with what is left over."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from pma_gym.data.trial_columns import BY_NAME
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.figure_text import signal_name, signal_unit
from pma_gym.discovery.report.pictures import AFTER, BEFORE, MEASURED, after_name
from pma_gym.discovery.result.misfit import TrialRecord
from pma_gym.pages.figures import legend_below, picture, png
from pma_gym.pages.interactive import InteractiveFigure, Trace
from pma_gym.units import SI_FACTORS

_MOST_SIGNALS = 2


def worst_trial(diagnosis: Diagnosis) -> TrialRecord | None:
    """The trial in which some signal missed by most, over its noise, before anything was done."""
    known = [each for each in diagnosis.trials if each.gaps]
    return max(known, key=lambda each: _excess(each, worst_signals(each)[0]), default=None)


def worst_signals(record: TrialRecord) -> list[str]:
    """A trial's signals, the worst missed first."""
    return sorted(record.gaps, key=lambda signal: -_excess(record, signal))


def _excess(record: TrialRecord, signal: str) -> float:
    gap = record.gaps[signal]
    return gap.before / gap.floor if gap.floor else gap.before


def curves_picture(record: TrialRecord, diagnosis: Diagnosis) -> bytes:
    """A trial's two worst signals: curves above, residuals with the noise's band below."""
    signals = worst_signals(record)[:_MOST_SIGNALS]
    with picture(5.2 * len(signals) if len(signals) > 1 else 7.4, 5.0) as drawn:
        panels = drawn.subplots(
            2, len(signals), sharex=True, squeeze=False, height_ratios=(1.5, 1.0)
        )
        for column, signal in enumerate(signals):
            _draw(record, signal, panels[0, column], panels[1, column])
        name = after_name(diagnosis) + (", held out" if record.held_out else "")
        handles = [
            Line2D([], [], label="measured", **MEASURED),  # type: ignore[arg-type]
            Line2D([], [], color=BEFORE, linestyle="--", label="model as given"),
            Line2D([], [], color=AFTER, label=name),
        ]
        legend_below(drawn, handles, 3)
        return png(drawn)


def curves_figure(record: TrialRecord, diagnosis: Diagnosis) -> InteractiveFigure:
    """A trial's worst signal to zoom and hover: measured, before and after."""
    signal = worst_signals(record)[0]
    name = after_name(diagnosis) + (", held out" if record.held_out else "")
    time = record.time.tolist()
    curves = (("measured", record.measured, ""), ("model as given", record.before, BEFORE))
    traces = [
        Trace(label, time, _file_key(record, values, signal).tolist(), color)
        for label, values, color in (*curves, (name, record.after, AFTER))
    ]
    caption = f"{signal_name(signal)} of {record.name}: drag to zoom, click a curve to hide it."
    label = f"{signal_name(signal)} ({signal_unit(signal)})"
    return InteractiveFigure("worst", caption, "time (s)", label, traces)


def _draw(record: TrialRecord, signal: str, above: Axes, below: Axes) -> None:
    unit = signal_unit(signal)
    measured = _file_key(record, record.measured, signal)
    before, after = (_file_key(record, each, signal) for each in (record.before, record.after))
    above.plot(record.time, measured, **_measured_style(measured))
    above.plot(record.time, before, color=BEFORE, linestyle="--")
    above.plot(record.time, after, color=AFTER)
    above.set_title(f"{signal_name(signal)}, {record.name}")
    above.set_ylabel(f"{signal_name(signal)} ({unit})")
    floor = record.gaps[signal].floor
    below.axhspan(-2.0 * floor, 2.0 * floor, color="#e3e6ea", zorder=0)
    for simulated, color in ((before, BEFORE), (after, AFTER)):
        below.plot(
            record.time, measured - simulated, **_left_style(measured), color=color, linewidth=0.9
        )
    below.set_ylabel(f"measured less\nsimulated ({unit})")
    below.set_xlabel("time (s)")


def _sparse(values: NDArray[np.float64]) -> bool:
    """Whether readings are so few that lines between them would hide them."""
    return 4 * int(np.isfinite(values).sum()) < values.size


def _measured_style(values: NDArray[np.float64]) -> dict[str, Any]:
    if _sparse(values):
        return {"marker": "o", "linestyle": "", "color": MEASURED["color"], "markersize": 5}
    return dict(MEASURED)


def _left_style(values: NDArray[np.float64]) -> dict[str, Any]:
    return {"marker": "o", "linestyle": "", "markersize": 4} if _sparse(values) else {}


def _file_key(record: TrialRecord, values: NDArray[np.float64], signal: str) -> NDArray[np.float64]:
    """One signal of an array of outputs, in its file unit."""
    column = BY_NAME[signal]
    return values[:, record.columns.index(signal)] / SI_FACTORS[column.unit]
