"""Cases in folders: what a diagnosis may read in one, the truth in another."""

import json
import re
import shutil
import tomllib
from functools import cache
from pathlib import Path

import numpy as np

import pma_gym
from benchmarks.hidden_effects.generation.cases import Case
from benchmarks.hidden_effects.physics.rig import Array
from benchmarks.hidden_effects.physics.simulation import RATE
from pma_gym.discovery.experiments.excitation import RATE_HZ, Excitation, library
from pma_gym.files import replace_file
from pma_gym.partials import begin_partial, end_partial
from pma_gym.plant.model import parse_model

HEADER = (
    "time_s,motor_voltage_v,regulator_voltage_v,contraction_mm,rotation_deg,load_n,pressure_kpa"
)


def lab_model() -> str:
    """The model file of the lab: `serres2008` without friction of the slide."""
    text = (Path(pma_gym.__file__).parent / "models" / "serres2008.toml").read_text("utf-8")
    text = re.sub(r"\[coulomb_friction\]\n(?:.+\n)+\n", "", text)
    text = text.replace('name = "serres2008"', 'name = "lab"', 1)
    return re.sub(r'title = ".*"', 'title = "What the lab believes"', text, count=1)


def case_name(number: int) -> str:
    """Name of a case's folder."""
    return f"case_{number:04d}"


def write_case(case: Case, folder: Path, number: int) -> None:
    """Write a case; its folder appears whole or not at all, after its truth."""
    name = case_name(number)
    for part in ("cases", "truth"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    truth = json.dumps(case.truth, indent=1) + "\n"
    replace_file(folder / "truth" / f"{name}.json", truth.encode())
    target = folder / "cases" / name
    draft = begin_partial(target)
    try:
        draft.mkdir()
        for file, text in (case.files or _station_files(case)).items():
            (draft / file).write_text(text, "utf-8")
        shutil.rmtree(target, ignore_errors=True)
        draft.rename(target)
    finally:
        end_partial(draft)


def _station_files(case: Case) -> dict[str, str]:
    """Texts of a station's data set by name."""
    texts = {trial_name(i): _csv(case, i) for i in range(len(case.time))}
    return texts | {"dataset.toml": _dataset(case), "model.toml": lab_model()}


def trial_name(i: int) -> str:
    """Name of a trial's file."""
    return f"trial_{i + 1:02d}.csv"


def _csv(case: Case, i: int) -> str:
    rows = [HEADER]
    columns = (case.time[i], case.motor[i], case.regulator[i], *case.readings[i].T)
    for time, motor, regulator, *signals in zip(*columns, strict=True):
        # A ten-thousandth is less than a hundredth of any sensor's step.
        texts = [f"{value:.4f}" for value in signals]
        rows.append(",".join([f"{time:.7f}", f"{motor:.3f}", f"{regulator:.3f}", *texts]))
    return "\n".join(rows) + "\n"


def _dataset(case: Case) -> str:
    lines = ['title = "Trials of a muscle"', 'model = "model.toml"']
    for i in range(len(case.time)):
        lines += ["", f'[trials."{trial_name(i)}"]', f"order = {i + 1}"]
        if i in case.repeat_of:
            lines.append(f'repeat_of = "{trial_name(case.repeat_of[i])}"')
    return "\n".join(lines) + "\n"


Volts = tuple[Array, Array]
"""Motor and regulator voltages at `RATE`, shape (rows,) each."""


@cache
def safe_experiments() -> tuple[Excitation, ...]:
    """The whole library, as large as is safe by what the lab believes."""
    assert RATE_HZ == RATE, "the library and the generator count rows alike"
    return tuple(library([parse_model(tomllib.loads(lab_model()))]))


def named(prefix: str, g: np.random.Generator) -> tuple[str, Volts]:
    """Name and volts of an excitation whose name begins with words, at one of its settings.

    Raises:
        ValueError: there is none.
    """
    experiments = [each for each in safe_experiments() if each.name.startswith(prefix)]
    if not experiments:
        raise ValueError(f"the library has no excitation that begins with {prefix!r}")
    chosen = experiments[int(g.integers(len(experiments)))]
    return chosen.name, volts(chosen)


def random_experiment(g: np.random.Generator, rows: int) -> tuple[str, Volts]:
    """A random excitation, cut or repeated so that it takes as many rows as another."""
    every = safe_experiments()
    chosen = every[int(g.integers(len(every)))]
    motor, regulator = (np.resize(column, rows) for column in volts(chosen))
    return chosen.name, (motor, regulator)


def volts(excitation: Excitation) -> Volts:
    """Its commands, in whole millivolts as a lab sends them."""
    commands = excitation.trial.commands
    return (
        np.round(commands["motor_voltage"], 3),
        np.round(commands["regulator_voltage"], 3),
    )
