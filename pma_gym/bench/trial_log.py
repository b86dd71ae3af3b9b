"""The log of a rig: a data set that grows row by row, and the times of its steps."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from pma_gym.bench.control_loop import Log, Step
from pma_gym.bench.rig import RigError
from pma_gym.bench.rig_file import RigFile
from pma_gym.data.datasets.dataset_toml import DESCRIPTION
from pma_gym.files import replace_file
from pma_gym.plant.model import dump_model, load_model

TIMES = "timing"
"""Folder of the steps' times, beside the trials."""


class TrialLog:
    """A folder of trials: `dataset.toml`, `model.toml`, `trial-001.csv`, `timing/trial-001.csv`.

    Each row goes to the system as a whole when its step ends, so that a killed process leaves a
    file that ends with its last row.

    Args:
        folder: of the data set; made where its parent exists.
        rig: content of the rig's file.
    """

    def __init__(self, folder: Path, rig: RigFile) -> None:
        """Write what describes the trials.

        Raises:
            RigError: the folder has trials of another rig.
        """
        title = rig.title.replace("\\", "/").replace('"', "'")
        description = (
            f'title = "{title}"\nmodel = "model.toml"\n\n[format]\ninterpolation = "zoh"\n'
        )
        contents = {
            folder / "model.toml": dump_model(load_model(rig.model)).encode(),
            folder / DESCRIPTION: description.encode(),
        }
        (folder / TIMES).mkdir(parents=True, exist_ok=True)
        for path, content in contents.items():
            if path.exists() and path.read_bytes() != content:
                raise RigError(f"{path} is of another rig or model; name another folder")
            replace_file(path, content)
        self._folder = folder
        self._header = ("time_s", *rig.commands, *rig.measurements)

    @contextmanager
    def trial(self) -> Iterator[Log]:
        """Open the next trial's files; what is called after each step of `ControlLoop.run`."""
        names = (f"trial-{number:03}.csv" for number in count(1))
        name = next(name for name in names if not (self._folder / name).exists())
        options = os.O_WRONLY | os.O_CREAT | os.O_APPEND
        files = [os.open(self._folder / where / name, options) for where in (".", TIMES)]

        def write(time: float, commands: Sequence[float], values: Sequence[float], s: Step) -> None:
            rows = (time, *commands, *values), s
            for file, row in zip(files, rows, strict=True):
                os.write(file, (",".join(f"{value:.9g}" for value in row) + "\n").encode())

        try:
            for file, header in zip(files, (self._header, Step._fields), strict=True):
                os.write(file, (",".join(header) + "\n").encode())
            yield write
        finally:
            for file in files:
                os.close(file)
