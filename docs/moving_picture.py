"""Draws the moving picture of the README: open loop above closed loop, one rotation each."""

from pathlib import Path

import gymnasium as gym
import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

import pma_gym  # noqa: F401 - registers the environments
from controllers import PID, SerresReplay
from controllers.registry import Controller

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
        action = env.action(controller.act(env.reading, env.time))
        _, _, terminated, truncated, _ = env.step(action)
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
