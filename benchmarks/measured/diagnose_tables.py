"""`python -m benchmarks measured`: the diagnosis on the dissertation's own measurements."""

import json
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.files import write_text
from benchmarks.measured.held_out import Rig, limit_errors, repeat_scatter, rms, worked
from benchmarks.measured.trials import measured_dataset
from benchmarks.runner.fingerprint import code_digest
from pma_gym.cli.terminal import terminal_table
from pma_gym.data.datasets.dataset import Dataset
from pma_gym.data.files.trial_files import encode_trial
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.result.candidate import ADDED
from pma_gym.discovery.workflow import diagnose
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import Model, dump_model, load_model
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

LOADS_N, REPEATS = (150.0, 450.0, 900.0), (1, 3)
"""Loads that are diagnosed, and repeats: the first, rested, and the last, worked."""

I2_EVERY = 12
"""Every how many rows of I2 are diagnosed: they tell no more than how the pressure reads."""

MOST_ROUNDS = 2
"""Most diagnoses, one after the other: they bring the extension within a millimetre."""


def run_measured(
    out: Path, jobs: int = 1, seed: int = 0, console: Console | None = None
) -> dict[str, dict[str, float]]:
    """Diagnose round after round, and judge on pressures that took no part.

    Args:
        out: folder of `measured.json`, `model.toml` and the fits that an interrupted job goes on
            from.
        jobs: threads.
        seed: of simulated chance.
        console: where to print.
    Returns:
        Rms errors (file units) by model and figure.
    """
    console, initial_model = console or SafeConsole(), load_model(GIVEN)
    # Fits of other code go unused.
    code = code_digest()
    said, effects, amended = list[str](), list[str](), initial_model
    for number in range(1, MOST_ROUNDS + 1):
        with console.status(f"round {number}"):
            diagnosis = diagnose(
                diagnosed(DIAGNOSED_KPA, LOADS_N, REPEATS),
                amended,
                seed=seed,
                jobs=jobs,
                journal=out / "journal" / code,
            )
        console.print(f"Round {number}: {diagnosis.sentence}", highlight=False, markup=False)
        said.append(diagnosis.sentence)
        added = added_by(diagnosis)
        if not added:
            break
        effects, amended = effects + added, diagnosis.model
    with console.status("fitted to six pressures, judged on the other five"):
        rig = Rig.of(diagnosed(DIAGNOSED_KPA), initial_model, jobs)
        models = {"as given": initial_model, "parameters refitted": rig.fit((), amended)}
        models[f"with {', '.join(effects)}" if effects else "amended"] = rig.fit(effects, amended)
        errors = {name: unseen_errors(model) for name, model in models.items()}
    errors["scatter of the repeats"] = repeat_scatter(measured_dataset(steps=0))
    write_text(out / "model.toml", dump_model(worked(list(models.values())[-1])))
    result = {"rounds": said, "effects": effects, "unseen_kpa": UNSEEN_KPA, "errors": errors}
    write_text(out / "measured.json", json.dumps(result, indent=1) + "\n")
    rows = [
        [name, *(f"{each:.2f}" for each in figures.values())] for name, figures in errors.items()
    ]
    header = ["model", *errors["as given"]]
    title = "Errors (rms) at pressures that took no part"
    console.print(terminal_table(TextTable(title, header, rows)))
    return errors


def added_by(diagnosis: Diagnosis) -> list[str]:
    """Effects that a diagnosis added to its model; one that cannot decide has added none.

    One that says `unknown`, because what it added leaves too much, has added effects all the same.
    """
    if diagnosis.verdict not in ("effect", "unknown"):
        return []
    return [each.name for each in diagnosis.candidates if each.why == ADDED]


def unseen_errors(model: Model) -> dict[str, float]:
    """Rms errors at the pressures that took no part, by figure."""
    errors = limit_errors(model, measured_dataset(UNSEEN_KPA, steps=0))
    return {name: rms(each) for name, each in errors.items()}


def diagnosed(
    pressures_kpa: Sequence[float],
    loads_n: Sequence[float] | None = FITTED_N,
    repeats: Sequence[int] | None = FITTED_REPEATS,
) -> Dataset:
    """The trials of some pressures, loads and repeats that are diagnosed, or fitted to."""
    return measured_dataset(pressures_kpa, loads_n, repeats, I2_EVERY)


def write_trials(folder: Path) -> int:
    """Write the trials that are diagnosed as a data set that `pma-gym diagnose` reads.

    Args:
        folder: a CSV file a trial and dataset.toml.
    Returns:
        How many trials.
    """
    data = diagnosed(DIAGNOSED_KPA, repeats=None)
    lines = [f'title = "{data.title}"', f'model = "{data.model}"']
    for each in data.trials:
        write_text(folder / each.name, encode_trial(each.trial, each.name).decode())
        lines += [f'[trials."{each.name}"]', f"order = {each.order:g}"]
        if each.repeat_of is not None:
            lines.append(f'repeat_of = "{each.repeat_of}"')
    write_text(folder / "dataset.toml", "\n".join(lines) + "\n")
    return len(data)
