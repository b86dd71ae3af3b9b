"""The benchmark on any rig's model: tune what has settings, run, report."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.progress import Progress

from benchmarks.rigs.from_logs import settings_of, write_report
from benchmarks.rigs.policy import SEES, RigPolicy
from benchmarks.rigs.score import Score, info_of, scores
from benchmarks.rigs.suite import varied
from controllers.rigs import RIG_CONTROLLERS, RigController
from pma_gym.documents import read_toml
from pma_gym.envs import RigEnv
from pma_gym.plant.model import load_model


def rig_options(model: str, environment: str) -> dict[str, Any]:
    """Options of the environment: of a TOML text or file, drawn parameters if it names none."""
    table = (
        read_toml(Path(environment))
        if environment.endswith(".toml")
        else tomllib.loads(environment)
    )
    known = load_model(model)
    drawn = (
        "intervals" if any(note.low is not None for note in known.notes.values()) else varied(known)
    )
    return {"model": known, "randomisation": drawn, **table}


def chosen_controllers(
    names: Sequence[str],
    options: Mapping[str, Any],
    tasks: Sequence[str],
    out: Path,
    progress: Progress,
) -> dict[str, tuple[RigController, Mapping[str, Any]]]:
    """Controllers by name or policy file, tuned where they have settings.

    Raises:
        ValueError: an unknown one, or one that does not apply to the rig.
    """
    made: dict[str, tuple[RigController, Mapping[str, Any]]] = {}
    info = info_of(RigEnv(tasks[0], **options))
    for name in names or list(RIG_CONTROLLERS):
        if name.endswith(".zip"):
            made[Path(name).stem] = RigPolicy(Path(name), options), SEES
            continue
        if name not in RIG_CONTROLLERS:
            known = ", ".join(RIG_CONTROLLERS)
            raise ValueError(f"a controller of any rig is {known} or a policy's .zip, got {name!r}")
        missing = RIG_CONTROLLERS[name].missing(info)
        if missing and not names:
            print(f"Without {name}: {missing}")
            continue
        if missing:
            raise ValueError(f"{name} does not apply to model {info.model.name}: {missing}")
        settings = settings_of(out, f"{name}-{info.model.name}", name, options, tasks, progress)
        made[name] = RIG_CONTROLLERS[name](settings), {}
    return made


def run_rig(
    model: str,
    tasks: Sequence[str],
    controllers: Sequence[str],
    environment: str,
    seeds: int,
    out: Path,
) -> list[Score]:
    """Compare controllers on a rig's tasks and write the report; see `python -m benchmarks run`."""
    options = rig_options(model, environment)
    first = RigEnv(**options).options.signals[0].name
    tasks = list(tasks) or [f"{first}_{kind}" for kind in ("steps", "ramps", "multisine")]
    with Progress() as progress:
        made = chosen_controllers(controllers, options, tasks, out, progress)
    name = load_model(model).name
    rows = scores(name, options, made, tasks, range(seeds))
    write_report(out, f"Controllers on {name}", rows)
    return rows
