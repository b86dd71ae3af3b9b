"""Cases in folders: what a diagnosis may read in one, the truth in another."""

import json
import re
import shutil
from pathlib import Path

import pma_gym
from benchmarks.hidden_effects.generation.cases import Case
from pma_gym.files import replace_file
from pma_gym.partials import begin_partial, end_partial

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
