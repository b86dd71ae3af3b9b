"""Films from pictures: GIF by Pillow, a dependency of matplotlib, and MP4 by imageio-ffmpeg."""

import importlib
import io
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from pma_gym.files import OutputError, replace_file

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
