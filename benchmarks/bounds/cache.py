"""Achievable bounds that a page needs: computed beside it in other processes, kept for the next."""

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from benchmarks.bounds import achievable, open_loop
from benchmarks.bounds.achievable import achievable_bound
from benchmarks.executors.executor import Executor, run_all
from benchmarks.executors.local import Background
from benchmarks.files import write_text
from benchmarks.runner.fingerprint import code_digest_with
from pma_gym.documents import read_json
from pma_gym.plant.model import dump_model, load_model

BOUNDS = "bounds.json"
"""File of the bounds that are known, in the page's folder."""

Trial = tuple[str, float]
"""Task and pressure (kPa)."""

Compute = Callable[[str, str, float], float]


def least_return_error(model: str, task: str, pressure_kpa: float) -> float:
    """The achievable bound of phase III (mm or deg)."""
    return achievable_bound(model, task, pressure_kpa)["III"]


class Bounds:
    """Achievable bounds of phase III on a model; each is computed once.

    One takes seconds: the oracle has to drive the trial. `start` lets other processes begin, and a
    call waits for its own. What a folder keeps counts only if it was made with this code and model.

    Args:
        model: shipped name, or path of a TOML file.
        folder: where bounds are kept; nowhere if None.
        compute: the bound of a model, task and pressure (kPa).
    """

    def __init__(
        self, model: str, folder: Path | None = None, compute: Compute = least_return_error
    ) -> None:
        self._model, self._compute = model, compute
        self._path = None if folder is None else folder / BOUNDS
        self._key = _key(model) if self._path else ""
        self._known = self._read()
        self._running: dict[Trial, Background[float]] = {}

    def start(self, trials: Iterable[Trial]) -> None:
        """Compute bounds that will be asked for, in a process each, as many as there are cores."""
        for trial in trials:
            if trial in self._known or len(self._running) >= (os.cpu_count() or 1):
                continue
            self._running[trial] = Background(partial(self._compute, self._model, *trial))

    def __call__(self, task: str, pressure_kpa: float) -> float:
        """The bound (mm or deg) of a task at a pressure (kPa)."""
        trial = task, pressure_kpa
        if trial not in self._known:
            self._known[trial] = self._computed(trial)
            self._write()
        return self._known[trial]

    def compute(self, trials: Iterable[Trial], executor: Executor) -> tuple[dict[Trial, str], bool]:
        """Compute bounds on an executor; each is kept as it is done.

        Args:
            trials: task and pressure (kPa) of each.
            executor: where.
        Returns:
            Why those that failed have no bound, and whether all was run: Ctrl-C ends it.
        """
        missing = [trial for trial in trials if trial not in self._known]
        failures: dict[Trial, str] = {}

        def keep(index: int, result: object) -> None:
            trial = missing[index]
            if isinstance(result, BaseException):
                failures[trial] = f"{type(result).__name__}: {result}"
            else:
                assert isinstance(result, float)
                self._known[trial] = result
                self._write()

        works = [partial(self._compute, self._model, *trial) for trial in missing]
        return failures, run_all(works, executor, keep)

    def known(self, task: str, pressure_kpa: float) -> float | None:
        """The bound (mm or deg) of a task at a pressure (kPa), if it is there."""
        return self._known.get((task, pressure_kpa))

    def _computed(self, trial: Trial) -> float:
        running = self._running.pop(trial, None)
        return running.result() if running else self._compute(self._model, *trial)

    def _read(self) -> dict[Trial, float]:
        """What the folder keeps; nothing if it is damaged or was made with something else."""
        if self._path is None:
            return {}
        try:
            document = read_json(self._path, own=True)
            rows = document["bounds"] if document["key"] == self._key else []
            return {(str(task), float(kpa)): float(least) for task, kpa, least in rows}
        except (OSError, ValueError, KeyError, TypeError):
            return {}

    def _write(self) -> None:
        if self._path is None:
            return
        rows = [[task, kpa, least] for (task, kpa), least in sorted(self._known.items())]
        write_text(self._path, json.dumps({"key": self._key, "bounds": rows}, indent=1) + "\n")

    def close(self) -> None:
        """End what still runs."""
        for running in self._running.values():
            running.end()
        self._running.clear()

    def __enter__(self) -> "Bounds":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _key(model: str) -> str:
    """Digest of what a bound depends on: code and model."""
    files = [Path(str(module.__file__)) for module in (achievable, open_loop)]
    text = code_digest_with(files) + dump_model(load_model(model))
    return hashlib.sha256(text.encode()).hexdigest()[:16]
