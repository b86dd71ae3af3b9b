"""The page of the job: what was found first, then by how much each effect helps."""

import numpy as np
from rich.console import Console

from benchmarks.measured.steps import PHASE_NAMES
from benchmarks.measured.tables import (
    COLUMNS,
    REPLAY_HEADER,
    TARGET_MM,
    Measured,
    error_rows,
    experiment_text,
    readable,
    replay_rows,
    round_rows,
    verdict_text,
)
from pma_gym.cli.terminal import terminal_table
from pma_gym.discovery.report.pictures import AFTER, BEFORE, FLOOR, PARAMETERS
from pma_gym.pages.document import Block, Callout, Heading, Paragraph, Picture, TextTable, to_html
from pma_gym.pages.figures import legend_below, picture, png
from pma_gym.terminal import SafeConsole

WIDTH = 120
"""Columns of text where there is no terminal."""

_SHOWN = (("extension_mm", "extension, rms error (mm)"), ("rotation_deg", "rotation, rms (deg)"))
_REPLAYS = (("displacement", "mm"), ("I", "deg"), ("II", "deg"), ("III", "deg"))


def measured_page(result: Measured) -> str:
    """All of it as one page of HTML that needs nothing else."""
    pictures = {"errors": errors_picture(result), "replays": replays_picture(result)}
    return to_html(_blocks(result), pictures)


def _blocks(result: Measured) -> list[Block]:
    effects = [readable(name) for name in result.steps[-1].effects]
    names = tuple(label for _, label in COLUMNS)
    return [
        Heading("Tables I2 and I3, diagnosed", 1),
        Callout(
            f"Beginning with `{result.settings['model']}`, the diagnosis added "
            f"{', '.join(effects) or 'nothing'}.",
            tone="good",
        ),
        *(Paragraph(text) for text in verdict_text(result)),
        Picture(
            "errors",
            "Error of table I3's rows from the commands alone, model after model: at pressures "
            "that took no part in the choice of effects or in the fit, and at those that did. "
            "The dashed line is the scatter of the repeats about their mean.",
        ),
        TextTable(
            "Errors (rms) at pressures that took no part", ("model", *names), error_rows(result)
        ),
        TextTable(
            "The diagnoses, one after the other",
            ("round", "trials", "verdict", "added", "p", "explains as much"),
            round_rows(result.rounds),
            words=3,
        ),
        *(Paragraph(each.sentence) for each in result.rounds),
        Heading("Tables that took no part"),
        Picture(
            "replays",
            "The printed voltages of the displacement and rotation trials, open loop: mean "
            "absolute error of the mean position against tables 21 and 27-29.",
        ),
        *(
            TextTable(
                f"{label}: mean absolute error (mm or deg, slope a second)",
                REPLAY_HEADER,
                replay_rows(result, phase),
            )
            for phase, label in PHASE_NAMES.items()
        ),
        *(Paragraph(text) for text in experiment_text(result)),
    ]


def print_measured(result: Measured, console: Console) -> None:
    """The page's tables, and what is said of targets and experiments."""
    console = console if console.is_terminal else SafeConsole(file=console.file, width=WIDTH)
    for block in _blocks(result):
        if isinstance(block, TextTable):
            console.print(terminal_table(block))
    for line in (*experiment_text(result), *verdict_text(result)):
        console.print(line, highlight=False)


def errors_picture(result: Measured) -> bytes:
    """Errors before and after each effect, seen and unseen pressures, with the floor."""
    labels = [readable(step.name) for step in result.steps]
    at = np.arange(len(labels))
    with picture(9.0, 1.2 + 0.42 * len(labels)) as drawn:
        panels = drawn.subplots(1, len(_SHOWN), sharey=True)
        handles = []
        for panel, (key, title) in zip(panels, _SHOWN, strict=True):
            unseen = [step.unseen[key] for step in result.steps]
            seen = [step.seen[key] for step in result.steps]
            one = panel.barh(at - 0.2, unseen, 0.38, color=PARAMETERS, label="took no part")
            two = panel.barh(at + 0.2, seen, 0.38, color=AFTER, label="fitted to")
            panel.bar_label(one, [f"{value:.2f}" for value in unseen], padding=2, fontsize=8)
            handles = [one, two, panel.axvline(result.floors[key], label="repeats", **FLOOR)]
            panel.set(
                xscale="log",
                xlim=(0.4 * result.floors[key], 2.2 * max(*unseen, *seen)),
                xlabel=title,
            )
            panel.set_yticks(at, labels)
            panel.grid(visible=False, axis="y")
        goal = panels[0].axvline(TARGET_MM, color=BEFORE, linewidth=1.0, label="target, 1 mm")
        panels[0].invert_yaxis()
        legend_below(drawn, [*handles, goal], 4)
        return png(drawn)


def replays_picture(result: Measured) -> bytes:
    """Error of the mean position in each phase, model after model."""
    labels = [readable(step.name) for step in result.steps]
    at = np.arange(len(labels))
    with picture(9.0, 1.0 + 0.36 * len(labels)) as drawn:
        panels = drawn.subplots(1, len(_REPLAYS), sharey=True)
        for panel, (phase, unit) in zip(panels, _REPLAYS, strict=True):
            values = [
                next((float(e["mean"]) for e in step.replay if e["phase"] == phase), np.nan)  # type: ignore[arg-type]
                for step in result.steps
            ]
            bars = panel.barh(at, values, 0.65, color=PARAMETERS)
            panel.bar_label(bars, [f"{value:.2f}" for value in values], padding=2, fontsize=8)
            panel.set(
                title="displacement" if phase == "displacement" else f"rotation {phase}",
                xlabel=f"error ({unit})",
                xlim=(0.0, 1.25 * np.nanmax(values)),
            )
            panel.set_yticks(at, labels)
            panel.grid(visible=False, axis="y")
        panels[0].invert_yaxis()
        return png(drawn)
