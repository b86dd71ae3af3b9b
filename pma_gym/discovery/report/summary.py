"""A diagnosis as a few lines that a person can read aloud, and a fit as a table."""

import itertools
import re
from collections.abc import Iterator

from rich.table import Table

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.adequacy_text import floors_left
from pma_gym.discovery.report.effect_text import effect_name, effect_names, readable
from pma_gym.discovery.report.figure_text import (
    chance,
    estimate,
    estimate_text,
    figure,
    gap_closed,
    interval,
    percent,
    signal_name,
    signal_unit,
    undetermined_text,
    unit_cell,
)
from pma_gym.discovery.report.next_steps import what_to_do
from pma_gym.discovery.report.verdict_text import VERDICTS
from pma_gym.discovery.result.misfit import Gap
from pma_gym.terminal import table_console

_MOST_PLACES, _MOST_PARAMETERS = 3, 5


def diagnosis_summary(diagnosis: Diagnosis) -> str:
    """What was found: verdict, where, which effect, how large, how much it closes, what next."""
    lines = [f"{VERDICTS[diagnosis.verdict]}.", readable(diagnosis.sentence, diagnosis), ""]
    lines += [f"Note: {warning}" for warning in diagnosis.warnings]
    for name, entry in (
        ("Where", _places(diagnosis)),
        ("Effect", _effects(diagnosis)),
        ("Parameters", _parameters(diagnosis)),
        ("Misfit", _gaps(diagnosis)),
        ("Written", filter(None, [_written(diagnosis)])),
        ("Left", filter(None, [floors_left(diagnosis)])),
        ("Now", (_plain(step) for step in what_to_do(diagnosis))),
    ):
        labels = itertools.chain([f"{name}:"], itertools.repeat(""))
        lines += [f"{label:<12}{text}" for label, text in zip(labels, entry, strict=False)]
    return "\n".join(lines)


def _plain(text: str) -> str:
    """Without the marks of a page."""
    return re.sub(r"[`*]", "", text).replace(" beside this page", "")


def _places(diagnosis: Diagnosis) -> Iterator[str]:
    for place in diagnosis.where[:_MOST_PLACES]:
        share = f"{percent(place.share_of_gap)} of its misfit"
        yield f"{signal_name(place.signal)}, {place.region}: {share} ({chance(place.p_value)})"


def _effects(diagnosis: Diagnosis) -> Iterator[str]:
    for effect in diagnosis.effects:
        sizes = ", ".join(
            [
                *(f"{name} {estimate_text(known)}" for name, known in effect.parameters.items()),
                *(f"{name} {undetermined_text(e)}" for name, e in effect.undetermined.items()),
            ]
        )
        yield f"{effect_name(effect.name)}: {sizes}"
        if effect.confused_with:
            yield f"it could as well be {effect_names(effect.confused_with, 'or')}"


def _parameters(diagnosis: Diagnosis) -> Iterator[str]:
    moved = {path: each for path, each in diagnosis.parameters.items() if each.significant}
    for path, each in list(moved.items())[:_MOST_PARAMETERS]:
        yield f"{path} from {figure(each.start, 4)} to {estimate_text(each.now)}"
    if len(moved) > _MOST_PARAMETERS:
        yield f"and {len(moved) - _MOST_PARAMETERS} more"


def _gaps(diagnosis: Diagnosis) -> Iterator[str]:
    for signal, gap in diagnosis.gap.items():
        yield f"{signal_name(signal)} {_gap(gap, signal_unit(signal))}"


def _written(diagnosis: Diagnosis) -> str:
    """Misfit of the files that are written, on the trials that they were fitted to."""
    parts = [
        f"{signal_name(signal)} {figure(size)} {signal_unit(signal)}"
        for signal, size in diagnosis.written.items()
    ]
    return f"model.toml with trials.toml leaves {', '.join(parts)}" if parts else ""


def _gap(gap: Gap, unit: str) -> str:
    held = " (held out)" if gap.held_out else ""
    closed = "" if gap_closed(gap) is None else f"; {percent(gap_closed(gap))} of the gap closed"
    return (
        f"{figure(gap.before)} {unit} as given, {figure(gap.parameters)} refitted, "
        f"{figure(gap.after)} proposed{held}, noise {figure(gap.floor)}{closed}"
    )


def print_fit(diagnosis: Diagnosis) -> None:
    """Parameters before and after with intervals, what is not determined, and the misfit."""
    console = table_console()
    console.print(diagnosis.sentence, highlight=False, markup=False)
    for warning in diagnosis.warnings:
        console.print(f"Note: {warning}", highlight=False, markup=False)
    table = Table("parameter", title="Parameters", title_justify="left")
    for name in ("as given", "refitted", "95 % interval"):
        table.add_column(name, justify="right")
    table.add_column("unit")
    table.add_column("")
    unknown = {path: f"not identifiable: {why}" for path, why in diagnosis.not_identifiable.items()}
    for path, moved in diagnosis.parameters.items():
        now = moved.now
        value = estimate(now.value, now.low, now.high)
        note = unknown.pop(path, "differs" if moved.significant else "")
        cells = (path, figure(moved.start, 4), value, interval(now), unit_cell(now.unit), note)
        table.add_row(*cells)
    for path, note in unknown.items():
        table.add_row(path, "", "", "", "", note)
    console.print(table)
    gaps = Table("signal", title="Misfit (rms)", title_justify="left")
    for name in ("as given", "refitted", "noise"):
        gaps.add_column(name, justify="right")
    for signal, gap in diagnosis.gap.items():
        figures = map(figure, (gap.before, gap.after, gap.floor))
        gaps.add_row(f"{signal_name(signal)} ({signal_unit(signal)})", *figures)
    console.print(gaps)
    for line in filter(None, (_written(diagnosis), floors_left(diagnosis))):
        console.print(line, highlight=False, markup=False)
