"""Draws the pictures of README and documentation: `python docs/pictures.py`."""

import json
import os
import re
import tempfile
from pathlib import Path

import gymnasium as gym
import matplotlib.image
from moving_picture import draw_moving_picture
from page_plots import first_controller_plot, leaderboard_plot
from rich.console import Console
from trial_plots import controllers_plot, environment_plot, measured_plot, rig_plot

import pma_gym  # noqa: F401 - registers the environments
from benchmarks.exercise.choice import Choice
from benchmarks.exercise.choose_device import run_exercise
from benchmarks.exercise.profile import read_profile
from benchmarks.hidden_effects.evaluation.scoring import naming_picture
from controllers import SerresReplay
from pma_gym.data.datasets.dataset import read_dataset
from pma_gym.discovery import diagnose
from pma_gym.discovery.report.curves import curves_picture, worst_trial
from pma_gym.discovery.report.pictures import gap_picture, map_picture

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
    for name, picture in (
        ("where", map_picture(diagnosis.maps[:1])),
        ("gap", gap_picture(dict(diagnosis.gap), ["as given", "refitted", "effect added"])),
        ("worst", curves_picture(worst, diagnosis)),
    ):
        (IMAGES / f"diagnosis-{name}.png").write_bytes(picture)


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
