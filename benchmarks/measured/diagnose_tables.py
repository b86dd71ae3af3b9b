"""`python -m benchmarks measured`: the diagnosis on the dissertation's own measurements."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from benchmarks.files import write_text
from benchmarks.measured.pages import measured_page, print_measured
from benchmarks.measured.rounds import MOST_ROUNDS, Stages, rounds
from benchmarks.measured.steps import folds, steps
from benchmarks.measured.tables import Measured
from benchmarks.measured.trials import measured_dataset
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.data.files.trial_files import encode_trial
from pma_gym.plant.model import load_model
from pma_gym.terminal import SafeConsole

GIVEN = "serres2008"
"""The model to begin with."""

DIAGNOSED_KPA = (150.0, 250.0, 300.0, 400.0, 500.0, 575.0)
"""Pressures that the diagnosis sees. Effects are chosen, and parameters fitted, without the other
five."""

UNSEEN_KPA = (200.0, 275.0, 350.0, 450.0, 550.0)
"""Pressures on which every step is judged."""

FITTED_N, FITTED_REPEATS = (75.0, 150.0, 300.0, 450.0, 675.0, 900.0), (1, 3)
"""Loads and repeats of I3 that the models are fitted to that are judged; all are judged on."""

LOADS_N = (150.0, 450.0, 900.0), FITTED_N
"""Loads that are diagnosed, at first and when nothing more shows in these."""

REPEATS = (1, 3), None
"""Repeats that are diagnosed: the first, rested, and the last, worked; then all three."""

I2_EVERY = 12
"""Every how many rows of I2 are diagnosed: they tell no more than how the pressure reads."""

FOLDS = ((150.0, 275.0, 400.0, 550.0), (200.0, 300.0, 450.0, 575.0), (250.0, 350.0, 500.0))
"""All pressures, each left out once from a fit of all effects."""


Tell = Callable[[str, int, int], None]


def run_measured(
    out: Path,
    jobs: int = 1,
    seed: int = 0,
    most: int = MOST_ROUNDS,
    console: Console | None = None,
    recompute: bool = False,
) -> Measured:
    """Diagnose, judge and write.

    Args:
        out: folder of `measured.json`, `measured.html` and `model.toml`, and of what an
            interrupted job goes on from.
        jobs: threads.
        seed: of simulated chance.
        most: most diagnoses, one after the other.
        console: where to print.
        recompute: anew what other code made.
    """
    console, start = console or SafeConsole(), time.perf_counter()
    stages = Stages(out / "stages", recompute)
    if others := stages.others():
        console.print(others, highlight=False, markup=False, soft_wrap=True)
    with _bar(console) as tell:
        result = _computed(stages, jobs, seed, most, tell)
    result = replace(result, seconds=time.perf_counter() - start)
    write_text(out / "model.toml", result.steps[-1].model)
    write_text(out / "measured.json", json.dumps(asdict(result), indent=1) + "\n")
    write_text(out / "measured.html", measured_page(result))
    print_measured(result, console)
    console.print(f"written: {out / 'measured.html'}, measured.json, model.toml")
    return result


def _computed(stages: Stages, jobs: int, seed: int, most: int, tell: Tell) -> Measured:
    """Diagnoses and what judges them, one stage after the other; the time it took is left 0."""
    initial_model = load_model(GIVEN)
    few, more = (diagnosed(DIAGNOSED_KPA, *which) for which in zip(LOADS_N, REPEATS, strict=True))
    diagnoses, amended = rounds(
        (few, more),
        initial_model,
        stages,
        seed,
        jobs,
        lambda number: lambda step, done, all: tell(f"round {number}: {step}", done, all),
        most,
    )
    effects = [name for each in diagnoses for name in each.effects]
    judged = judged_at(DIAGNOSED_KPA), judged_at(UNSEEN_KPA)
    stepped = steps(
        initial_model,
        amended,
        effects,
        (diagnosed(DIAGNOSED_KPA), *judged),
        stages,
        jobs,
        partial(tell, "effect by effect"),
    )
    left_out = folds(
        initial_model, amended, effects, _without, FOLDS, jobs, partial(tell, "pressures left out")
    )
    return Measured(
        diagnoses,
        stepped,
        left_out,
        floors(),
        0.0,
        _settings(seed, stages),
    )


def diagnosed(
    pressures_kpa: Sequence[float],
    loads_n: Sequence[float] | None = FITTED_N,
    repeats: Sequence[int] | None = FITTED_REPEATS,
) -> Dataset:
    """The trials of some pressures, loads and repeats that are diagnosed, or fitted to."""
    return measured_dataset(pressures_kpa, loads_n, repeats, I2_EVERY)


def judged_at(pressures_kpa: Sequence[float]) -> Dataset:
    """All of I3's trials at some pressures."""
    return measured_dataset(pressures_kpa, steps=0)


def _without(pressures_kpa: Sequence[float]) -> tuple[Dataset, Dataset]:
    others = [each for each in (*DIAGNOSED_KPA, *UNSEEN_KPA) if each not in pressures_kpa]
    return diagnosed(others), judged_at(pressures_kpa)


def floors() -> dict[str, float]:
    """Scatter of I3's rows about the mean of their repeats (rms, in file units), by figure."""
    from benchmarks.measured.held_out import repeat_scatter

    return repeat_scatter(measured_dataset(steps=0))


def write_trials(folder: Path) -> int:
    """Write the trials that are diagnosed as a data set that `pma-gym diagnose` reads.

    Args:
        folder: a CSV file a trial and dataset.toml.
    Returns:
        How many trials.
    """
    data = diagnosed(DIAGNOSED_KPA, LOADS_N[-1], REPEATS[-1])
    lines = [f'title = "{data.title}"', f'model = "{data.model}"']
    for each in data.trials:
        write_text(folder / each.name, encode_trial(each.trial, each.name).decode())
        lines += [f'[trials."{each.name}"]', f"order = {each.order:g}"]
        if each.repeat_of is not None:
            lines.append(f'repeat_of = "{each.repeat_of}"')
    write_text(folder / "dataset.toml", "\n".join(lines) + "\n")
    return len(data)


def _settings(seed: int, stages: Stages) -> dict[str, Any]:
    return {
        "code": dict(stages.codes),
        "model": GIVEN,
        "seed": seed,
        "diagnosed_kpa": DIAGNOSED_KPA,
        "unseen_kpa": UNSEEN_KPA,
        "loads_n": LOADS_N,
        "repeats": REPEATS,
    }


@contextmanager
def _bar(console: Console) -> Iterator[Tell]:
    """A line that says what is being done."""
    columns = TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn()
    with Bar(*columns, console=console) as bar:
        task = bar.add_task("begins", total=None)

        def tell(step: str, done: int, total: int) -> None:
            bar.update(task, description=step, completed=done, total=total)

        yield tell
