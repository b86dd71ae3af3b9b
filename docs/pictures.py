"""Draws the pictures of README and documentation: `python docs/pictures.py`."""

import json
import os
import re
import runpy
import tempfile
from pathlib import Path
from typing import Any

import gymnasium as gym
import matplotlib.image
import numpy as np
from matplotlib import font_manager
from matplotlib.ticker import LogLocator, NullFormatter
from PIL import Image, ImageDraw, ImageFont
from rich.console import Console
from trial_plots import controllers_plot, environment_plot, measured_plot, rig_plot

import pma_gym  # noqa: F401 - registers the environments
from benchmarks.exercise.choose_device import Choice, run_exercise
from benchmarks.exercise.profile import read_profile
from benchmarks.hidden_effects.evaluation.scoring import naming_picture
from benchmarks.runner.rollout import make_environment, rollout
from controllers import PID, SerresReplay
from controllers.registry import Controller
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose
from pma_gym.discovery.report.curves import curves_picture, worst_trial
from pma_gym.discovery.report.pictures import gap_picture, map_picture
from pma_gym.pages.figures import legend_below, picture, png

DOCS = Path(__file__).parent
CONTROLLER_KPA = 300.0
BLUE, ORANGE, BLACK = "#0072B2", "#D55E00", "#000000"


def first_controller_plot() -> bytes:
    """Extension, error and voltage of the page's controller and of the PID, at 300 kPa."""
    integral = runpy.run_path(str(DOCS / "examples" / "integral.py"))["Integral"]
    with picture(8.0, 3.4) as figure:
        axes: Any = figure.subplots(1, 3)
        for controller, label, color in ((integral(), "Integral", ORANGE), (PID(), "PID", BLUE)):
            environment = make_environment("displacement", "station", CONTROLLER_KPA)
            trial = rollout(environment, controller, seed=1).trial
            ideal = 1e3 * environment.task.schedule.reference(trial.time)
            extension = 1e3 * trial.truth["extension"]
            curves = (extension, extension - ideal, trial.commands["motor_voltage"])
            for axis, values in zip(axes, curves, strict=True):
                axis.plot(trial.time, values, color=color, label=label)
        axes[0].plot(trial.time, ideal, color=BLACK, linestyle="--", label="Ideal")
        for axis, label in zip(
            axes, ("extension (mm)", "error (mm)", "motor voltage (V)"), strict=True
        ):
            axis.set(ylabel=label, xlabel="time (s)")
        legend_below(figure, axes[0].get_lines(), 3)
        return png(figure)


def leaderboard_plot() -> bytes:
    """Interquartile means with their intervals, as the table of docs/leaderboards.md has them."""
    names, columns, cells = _leaderboard_table((DOCS / "leaderboards.md").read_text("utf-8"))
    places = np.arange(len(names))[::-1]
    with picture(10.0, 4.6) as figure:
        axes: Any = figure.subplots(1, len(columns), sharey=True)
        for axis, column, intervals in zip(axes, columns, cells, strict=True):
            for place, interval in zip(places, intervals, strict=True):
                if interval is not None:
                    mean, low, high = interval
                    color = BLACK if place == 0 else BLUE
                    axis.plot([low, high], [place, place], color=color, linewidth=2.4)
                    axis.plot([mean], [place], color=color, marker="o", markersize=4.5)
            axis.set_xscale("log")
            low, high = axis.get_xlim()
            subs = (1.0,) if high > 1000.0 * low else (1.0, 3.0)
            axis.xaxis.set_major_locator(LogLocator(subs=subs, numticks=9))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_minor_formatter(NullFormatter())
            axis.set(title=column, xlabel="RMSE")
        axes[0].set_yticks(places, names)
        return png(figure)


Interval = tuple[float, float, float]


def _leaderboard_table(page: str) -> tuple[list[str], list[str], list[list[Interval | None]]]:
    """Names, columns, and by column a mean with its interval for each name, or None."""
    lines = [line for line in page.splitlines() if line.startswith("|")]
    header, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    columns = [
        f"{suite}:\n{name.split(': ')[-1]}"
        for suite, name in zip(("robust", "robust", "hard", "hard"), header[1:], strict=True)
    ]
    names = [row[0].replace(", tenth trial", "").replace(", shipped", "") for row in rows]
    return names, columns, [[_interval(row[at]) for row in rows] for at in range(1, len(header))]


def _interval(cell: str) -> Interval | None:
    """`1.25 [1.05, 1.45]` as numbers; None of a cell without."""
    if "[" not in cell:
        return None
    mean, low, high = (
        float(text) for text in cell.replace("[", "").replace("]", "").replace(",", "").split()
    )
    return mean, low, high


PRESSURE_KPA = 350
FRAMES_PER_SECOND = 8
SIZE = (640, 320)
TITLE_HEIGHT = 28
COLOURS = 64
ROWS: dict[str, type[Controller]] = {
    "Open loop: the dissertation's printed voltages (2008)": SerresReplay,
    "Closed loop: PID": PID,
}


def draw_moving_picture(path: Path) -> None:
    """Write one trial of each controller, simulated on the same station with the same seed, as GIF.

    Args:
        path: of the GIF.
    """
    columns = [_frames(title, make()) for title, make in ROWS.items()]
    frames = [Image.fromarray(np.vstack(rows)) for rows in zip(*columns, strict=True)]
    # One palette for all, so that what stands still has the same colours in every frame.
    palette = frames[-1].quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    few[0].save(
        path,
        save_all=True,
        append_images=few[1:],
        duration=round(1000 / FRAMES_PER_SECOND),
        loop=0,
        optimize=True,
    )


def _frames(title: str, controller: Controller) -> list[np.ndarray]:
    """Pictures of a trial, each with the title above it."""
    env = gym.make(
        "pma_gym/IsokineticRotation-v0", pressure_kpa=PRESSURE_KPA, render_mode="rgb_array"
    ).unwrapped
    env.reset(seed=1)
    controller.reset(env.reference, env.station)
    frames, ended = [_frame(title, env.render())], False
    while not ended:
        _, _, terminated, truncated, _ = env.step(env.action(controller.act(env.reading, env.time)))
        ended = terminated or truncated
        if env.time * FRAMES_PER_SECOND >= len(frames) - 1e-9:
            frames.append(_frame(title, env.render()))
    env.close()
    return frames


def _frame(title: str, picture: np.ndarray) -> np.ndarray:
    shown = Image.new("RGB", (SIZE[0], SIZE[1] + TITLE_HEIGHT), "white")
    shown.paste(Image.fromarray(picture).resize(SIZE, Image.Resampling.LANCZOS), (0, TITLE_HEIGHT))
    bold = font_manager.findfont("DejaVu Sans:bold")
    ImageDraw.Draw(shown).text((11, 7), title, "#1a1a1a", ImageFont.truetype(bold, 15))
    return np.asarray(shown)


IMAGES = Path(__file__).parent / "images"
STOP_S = 4.0


def draw_station() -> None:
    """The environment's own frame: the dissertation's voltages at 350 kPa, 4 s after the start."""
    env = gym.make(
        "pma_gym/IsokineticDisplacement-v0", pressure_kpa=350, render_mode="rgb_array"
    ).unwrapped
    replay = SerresReplay()
    env.reset(seed=1)
    replay.reset(env.reference, env.station)
    while env.time < STOP_S - 1e-9:
        env.step(env.action(replay.act(env.measurement, env.time)))
    IMAGES.mkdir(exist_ok=True)
    matplotlib.image.imsave(IMAGES / "station.png", env.render())


def draw_diagnosis() -> None:
    """What the tutorial's diagnosis shows: where, how much each step closes, the worst trial."""
    page = (Path(__file__).parent / "diagnosis.md").read_text(encoding="utf-8")
    block = re.search(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert block is not None
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            exec(block[1], {})
            diagnosis = diagnose(read_dataset("lab"), "serres2008", jobs=2)
        finally:
            os.chdir(here)
    worst = worst_trial(diagnosis)
    assert worst is not None
    for name, drawn in (
        ("where", map_picture(diagnosis.maps[:1])),
        ("gap", gap_picture(dict(diagnosis.gap), ["as given", "refitted", "effect added"])),
        ("worst", curves_picture(worst, diagnosis)),
    ):
        (IMAGES / f"diagnosis-{name}.png").write_bytes(drawn)


def draw_hidden_effects() -> None:
    """How often an effect was named by its size, from the figures beside the documentation."""
    kept = Path(__file__).parent / "figures"
    blocks = json.loads((kept / "hidden-effects.json").read_text("utf-8"))["blocks"]
    ranges = [*blocks["faint"]["by_size"], *blocks["single"]["by_size"]]
    (IMAGES / "diagnosis-naming.png").write_bytes(naming_picture(ranges))


def draw_exercise() -> None:
    """The exercise device's moments, with the smallest configuration for the page's profile."""
    page = (Path(__file__).parent / "exercise-design.md").read_text(encoding="utf-8")
    block = re.search(r"```csv\n(.*?)```", page, flags=re.DOTALL)
    assert block is not None
    with tempfile.TemporaryDirectory() as folder:
        profile = Path(folder) / "profile.csv"
        profile.write_text(block[1], encoding="utf-8")
        run_exercise(Choice(), read_profile(profile), Path(folder), Console(quiet=True))
        drawn = (Path(folder) / "plots" / "exercise.png").read_bytes()
    (IMAGES / "exercise.png").write_bytes(drawn)


if __name__ == "__main__":
    (IMAGES / "first-controller.png").write_bytes(first_controller_plot())
    (IMAGES / "leaderboards.png").write_bytes(leaderboard_plot())
    (IMAGES / "controllers.png").write_bytes(controllers_plot())
    (IMAGES / "environment.png").write_bytes(environment_plot())
    (IMAGES / "rig.png").write_bytes(rig_plot())
    (IMAGES / "measured.png").write_bytes(measured_plot())
    draw_station()
    draw_moving_picture(IMAGES / "rotation.gif")
    draw_diagnosis()
    draw_hidden_effects()
    draw_exercise()
