"""Draws the pictures of README and documentation: `python docs/pictures.py`."""

from pathlib import Path

import gymnasium as gym
import matplotlib.image

import pma_gym  # noqa: F401 - registers the environments
from controllers import SerresReplay

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
        env.step(env.action(replay.act(env.reading, env.time)))
    IMAGES.mkdir(exist_ok=True)
    matplotlib.image.imsave(IMAGES / "station.png", env.render())


if __name__ == "__main__":
    draw_station()
