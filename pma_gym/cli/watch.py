"""`pma-gym watch`: a trial in a window at real time, or as a film.

Films from pictures: GIF by Pillow, a dependency of matplotlib, and MP4 by imageio-ffmpeg.
"""

import importlib
import io
import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from gymnasium.error import DependencyNotInstalled
from PIL import Image

from pma_gym.cli.controller_source import controller_of
from pma_gym.cli.terminal import NamedModel, read, task_names
from pma_gym.data.trial import TrialError
from pma_gym.envs import PMAEnv
from pma_gym.files import OutputError, check_output, replace_file

FILMS = (".mp4", ".gif")
"""File name extensions of films."""


def write_film(path: Path, frames: Sequence[np.ndarray], rate_hz: float) -> None:
    """Write a film to a file, completely or not at all.

    Args:
        path: file, ending in one of `FILMS`.
        frames: RGB of one shape (height, width, 3), uint8.
        rate_hz: pictures a second (Hz).
    Raises:
        OutputError: an MP4 without imageio-ffmpeg; with the command to install it.
    """
    made = _gif if path.suffix.lower() == ".gif" else _mp4
    replace_file(path, made(frames, rate_hz))


def _gif(frames: Sequence[np.ndarray], rate_hz: float) -> bytes:
    images = [Image.fromarray(frame).quantize(64) for frame in frames]
    out = io.BytesIO()
    images[0].save(
        out,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=round(1e3 / rate_hz),
        loop=0,
    )
    return out.getvalue()


def _mp4(frames: Sequence[np.ndarray], rate_hz: float) -> bytes:
    try:
        ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ModuleNotFoundError as error:
        raise OutputError(
            "an .mp4 is written by imageio-ffmpeg, which is not installed: pip install "
            '"pma-gym[view]", or name a .gif'
        ) from error
    height, width, _ = frames[0].shape
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        writer = ffmpeg.write_frames(
            str(path), (width, height), fps=rate_hz, macro_block_size=1, ffmpeg_log_level="error"
        )
        writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
        writer.close()
        return path.read_bytes()


Voltage = Callable[[PMAEnv], float]
"""Voltage of the task's actuator (V) for the next control step."""

FILM_RATE_HZ = 25.0
"""Pictures of a film a second."""

SWING_V, SWING_S = 3.0, 5.0
"""Without a controller the voltage rises by so much (V) and falls again in so long (s)."""


def watch(
    controller: Annotated[
        str | None,
        typer.Option(
            help="file.py:Class, module:Class, or a file of commands (CSV, XLSX...); else the "
            "voltage rises and falls slowly."
        ),
    ] = None,
    task: Annotated[
        str, typer.Option(help="Name of a task.", autocompletion=task_names)
    ] = "displacement",
    pressure: Annotated[float, typer.Option(help="Gauge pressure at the start (kPa).")] = 300.0,
    model: NamedModel = "station",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise and of what is drawn.")] = 0,
    video: Annotated[
        Path | None, typer.Option(help="Write a film instead: a file ending in .mp4 or .gif.")
    ] = None,
    width: Annotated[int, typer.Option(help="Width of the picture (pixels).")] = 800,
) -> None:
    """Watch a trial in a window at real time, or write it as a film."""
    if video is not None:
        _check_film(video)
    mode = "human" if video is None else "rgb_array"
    try:
        env = PMAEnv(task, mode, width, model=model, pressure_kpa=pressure)
    except DependencyNotInstalled as error:
        raise OutputError(str(error)) from error
    chosen = _voltages(controller, env)
    env.reset(seed=seed)
    frames = _run(env, chosen(env), filmed=video is not None)
    summary = {} if env.window_closed else env.episode_summary()
    env.close()
    if video is not None:
        write_film(video, frames, FILM_RATE_HZ)
        print(f"{len(frames)} pictures, {len(frames) / FILM_RATE_HZ:g} s: {video}")
    for name, value in summary.items():
        if name.startswith("rmse_") and isinstance(value, float):
            print(f"{name} {value:.4g}")


def _check_film(video: Path) -> None:
    """Refuse a film that could not be written, before the trial is run."""
    if video.suffix.lower() not in FILMS:
        raise OutputError(
            f"cannot write {video}: a film ends in {' or '.join(FILMS)}; name it "
            f"{video.stem or 'film'}.gif"
        )
    check_output(video)


def _run(env: PMAEnv, volts: Voltage, filmed: bool) -> list[np.ndarray]:
    """Run the episode to its end, or until the window is closed; pictures, if it is filmed."""
    frames: list[np.ndarray] = []
    over = False
    while not over and not env.window_closed:
        if filmed and env.time * FILM_RATE_HZ >= len(frames) - 1e-6:
            frames.append(env.picture())
        *_, terminated, truncated, _ = env.step(env.action(volts(env)))
        over = terminated or truncated
    if filmed:
        frames.append(env.picture())
    return frames


def _voltages(source: str | None, env: PMAEnv) -> Callable[[PMAEnv], Voltage]:
    """What makes the voltages, given the environment once it has begun."""
    if source is None:
        return lambda environment: _swing(environment.regulator_voltage)
    if ":" in source.replace(":\\", ""):
        controller = controller_of(source)

        def prepared(environment: PMAEnv) -> Voltage:
            controller.reset(environment.reference, environment.station)
            return lambda now: float(controller.act(now.measurement, now.time))

        return prepared
    return lambda environment: _commands(Path(source), environment)


def _swing(rest_voltage: float) -> Voltage:
    """A voltage that rises and falls; the regulator's from where it holds the pressure."""

    def volts(env: PMAEnv) -> float:
        start = rest_voltage if env.task.actuator == "regulator" else 0.0
        size = SWING_V if start == 0.0 else 0.2 * SWING_V
        return start + 0.5 * size * (1.0 - math.cos(2.0 * math.pi * env.time / SWING_S))

    return volts


def _commands(path: Path, env: PMAEnv) -> Voltage:
    """Voltages of the actuator from a command file, linear between its rows."""
    trial, name = read(path), f"{env.task.actuator}_voltage"
    if name not in trial.commands:
        raise TrialError(
            f"{path} commands {', '.join(trial.commands)}, but task {env.task.name} moves the "
            f"{env.task.actuator}: give a column {name}_v, or another --task"
        )
    column = trial.commands[name]
    return lambda now: float(np.interp(now.time, trial.time, column))
