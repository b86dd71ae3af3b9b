"""The report of a run: what stands in it, in which order, with which words."""

from collections.abc import Mapping
from typing import Any

from benchmarks.reproduction.plots import (
    actual_against_ideal_plot,
    rmse_figure,
    rmse_plot,
    tracking_figure,
    tracking_plot,
)
from benchmarks.reproduction.replay_page import replay_blocks
from benchmarks.reproduction.results import Results
from benchmarks.reproduction.tables import regression_table, rmse_table, summary_table
from benchmarks.runner.phase_score import PHASES
from pma_gym.pages.document import Block, Heading, Paragraph, Picture, TextTable
from pma_gym.pages.figures import Plot
from pma_gym.plant.model import load_model

_TASKS = {"displacement": "Isokinetic displacement", "rotation": "Isokinetic rotation"}


_KNOWLEDGE = (
    "Every controller but the printed feed-forward may read this very model, so the improved "
    "feed-forward shows what is left when the model is exact; no real station is known that well."
)


def report_blocks(results: Results) -> list[Block]:
    """The whole report."""
    suite = results.suite
    main = suite.models[0]
    blocks: list[Block] = [*_opening(results), summary_table(results)]
    for task in suite.pressures_kpa:
        blocks += _task_blocks(results, task, main)
    blocks += replay_blocks(results)
    for model in suite.models[1:]:
        blocks += _comparison_blocks(results, model)
    blocks += _failure_blocks(results)
    blocks += _origin_blocks(results)
    return blocks


def report_pictures(results: Results) -> dict[str, Plot]:
    """Every plot that the run has the figures for, as PNG by name."""
    pictures: dict[str, Plot] = {}
    for task, pressures in results.suite.pressures_kpa.items():
        pictures[f"rmse_{task}"] = rmse_plot(results, task)
        if any(results.trials(task, pressure) for pressure in pressures):
            pictures[f"tracking_{task}"] = tracking_plot(results, task)
            pictures[f"actual_against_ideal_{task}"] = actual_against_ideal_plot(results, task)
    return pictures


def _opening(results: Results) -> list[Block]:
    suite = results.suite
    count = len(results.scores)
    parts = [
        f"Suite `{suite.name}`, version {suite.version}: {len(suite.controllers)} controllers "
        f"through {sum(map(len, suite.pressures_kpa.values()))} trials on "
        f"{' and '.join(f'`{model}`' for model in suite.models)}, {count} cases; control at "
        f"{suite.control_rate_hz:g} Hz, sensor noise {'on' if suite.noise else 'off'}. Every trial "
        "is scored on the true motion at 384 Hz, 1923 samples a phase, as the dissertation "
        "scored its own (Serres 2008, tables 20–22 and 24–30).",
        f"`{suite.models[0]}`: {_title_of(suite.models[0])} {_KNOWLEDGE}",
    ]
    if suite.selected:
        parts.append("**This is a selection, not the suite as it is frozen.**")
    if results.failures:
        parts.append(f"**{len(results.failures)} of {count} cases failed**; see the end.")
    return [Heading(f"pma-gym benchmark: {suite.name}", 1), *(Paragraph(part) for part in parts)]


def _task_blocks(results: Results, task: str, model: str) -> list[Block]:
    """Tables and pictures of one task on the main model."""
    over_time, against_ideal = ("31", "32") if task == "displacement" else ("34", "36")
    pictured = [p for p in results.suite.pictured_kpa[task] if results.trials(task, p)]
    named = ", ".join(f"{pressure:g}" for pressure in pictured)
    return [
        Heading(f"{_TASKS[task]} on `{model}`"),
        *(rmse_table(results, model, task, phase) for phase in PHASES[task]),
        Picture(
            f"rmse_{task}",
            "RMSE by pressure, on a logarithmic scale; grey is what the dissertation measured "
            "with its feed-forward.",
            printed=True,
        ),
        rmse_figure(results, task),
        Picture(
            f"tracking_{task}",
            f"Response, error and motor voltage at {named} kPa (response: as figure {over_time} of "
            "the dissertation). Of the measured trials only the regression lines are printed.",
        ),
        *([tracking_figure(results, task)] if pictured else []),
        Picture(
            f"actual_against_ideal_{task}",
            f"Actual against ideal {task} at {named} kPa, as figure {against_ideal} of the "
            "dissertation.",
        ),
        *(regression_table(results, model, task, phase) for phase in PHASES[task]),
    ]


def _comparison_blocks(results: Results, model: str) -> list[Block]:
    tables: list[Block] = []
    for task in results.suite.pressures_kpa:
        tables += [rmse_table(results, model, task, phase) for phase in PHASES[task]]
        tables += [regression_table(results, model, task, phase) for phase in PHASES[task]]
    return [Heading(f"For comparison: `{model}`"), Paragraph(_title_of(model)), *tables]


def _failure_blocks(results: Results) -> list[Block]:
    if not results.failures:
        return []
    rows = [[names, reason] for names, reason in results.failure_reasons()]
    table = TextTable("Cases without figures", ["Case", "Why"], rows, words=2)
    return [Heading("Failed cases"), table]


def _origin_blocks(results: Results) -> list[Block]:
    """How the run can be made again."""
    info: Mapping[str, Any] = results.info
    reused = info.get("cases_reused", 0)
    went_on = f"; {reused} cases were done before" if reused else ""
    git = info["git"]
    state = {True: "with changes that are not committed", False: "clean", None: ""}[git["dirty"]]
    rows = [
        ["Commit", f"{git['commit']} {state}".strip()],
        ["Versions", ", ".join(f"{name} {text}" for name, text in info["versions"].items())],
        ["Machine", f"{info['platform']}, {info['processors']} processors"],
        ["Started", str(info["started"])],
        ["Command", f"`{info['command']}`"],
        ["Wall time", f"{info['wall_time_s']:.1f} s with {info['jobs']} processes{went_on}"],
        [
            "Environment steps",
            f"{info['environment_steps']}; in one process "
            f"{info['environment_steps_per_second']:.0f} a second inside `step`, "
            f"{info['case_steps_per_second']:.0f} with controllers and scoring",
        ],
        ["Seed", f"{results.suite.seed}; each case has its own, see `scores.csv`"],
    ]
    return [
        Heading("How it was made"),
        TextTable("Origin", ["", ""], rows, words=2),
        Paragraph(
            "`scores.csv` and `scores.json` beside this report hold every figure with all its "
            "digits. The same suite, model and versions give the same figures bit for bit."
        ),
    ]


def _title_of(model: str) -> str:
    return f"{load_model(model).title}."
