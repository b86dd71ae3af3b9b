"""From logs to a controller: diagnose, tune and train on the amended and the given model, score."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from benchmarks.files import csv_text, write_text
from benchmarks.rigs.policy import SEES, STEPS, RigPolicy, train
from benchmarks.rigs.score import Score, score_table, scores
from benchmarks.rigs.suite import varied
from benchmarks.rigs.tune import tuned
from controllers.rigs import RIG_CONTROLLERS, RigController
from pma_gym.cli.terminal import print_table
from pma_gym.data.datasets.dataset import Dataset, read_dataset
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.diagnosis import Covariance, RivalModel
from pma_gym.document_shape import ListOf, check_shape, shape_of
from pma_gym.pages.document import Block, Heading, Paragraph, to_html
from pma_gym.plant.model import Model, dump_model, load_model
from pma_gym.plant.sensors import direct_command
from pma_gym.tasks import OneOf, Ranges, Uncertainty

RATE_HZ = 50.0
"""Control rate."""

BANDWIDTH_HZ = 1000.0
"""Of a sensor of which the logs tell the noise alone (assumption)."""

CONTROLLERS = ("feedforward", "pid", "feedforward_pid", "lqg")
SEEDS = range(5)
TUNED = ("steps", "ramps", "multisine")
"""Kinds of references that settings are searched with, and controllers scored on."""


def amended(folder: Path) -> tuple[Model, OneOf]:
    """The model of a diagnosis with the sensors' noise, and what it may be in an episode.

    Effects of rivals are in the model and do nothing; every episode draws it or one of them, with
    parameters as uncertain as the fit has them.

    Args:
        folder: of the diagnosis.

    Raises:
        ValueError: `diagnosis.json` lacks covariance or rivals, or has them in another shape.
    """
    file = folder / "diagnosis.json"
    document = json.loads(file.read_text(encoding="utf-8"))
    model = with_noise(load_model(folder / "model.toml"), document["floors"])
    try:
        check_shape(
            document, {"covariance": shape_of(Covariance), "rivals": ListOf(shape_of(RivalModel))}
        )
        draws = [uncertainty_of(document["covariance"])]
        for rival in document["rivals"]:
            model = model.with_effects(rival["absent"])
            draws.append(replace(uncertainty_of(rival["covariance"]), values=rival["values"]))
    except ValueError as error:
        raise ValueError(f"{file}: {error}; diagnose the logs again") from error
    return model, OneOf(draws)


def uncertainty_of(covariance: Mapping[str, Any]) -> Uncertainty:
    """What draws parameters as a covariance of `diagnosis.json` has them."""
    paths, errors, rows = (covariance[each.name] for each in fields(Covariance))
    if {len(paths)} != {len(errors), len(rows), *map(len, rows)} and paths:
        raise ValueError(
            f"correlation must have {len(paths)} rows of {len(paths)} numbers and deviations as "
            f"many, as there are parameters; got {[*map(len, rows)]} and {len(errors)}"
        )
    return Uncertainty(tuple(paths), (np.array(rows) * np.outer(errors, errors)).tolist())


def with_noise(model: Model, floors: Mapping[str, Any]) -> Model:
    """A model with the sensors that a diagnosis tells the noise of, where it has none."""
    for signal in model.rig.signals:
        column = BY_QUANTITY[signal.name]
        floor = floors.get(column.name)
        if floor is not None and signal.sensor and signal.sensor not in model.parameters:
            noise = float(np.hypot(floor["value"], (floor["step"] or 0.0) / 12**0.5))
            values = {
                "bandwidth_hz": BANDWIDTH_HZ,
                column.name.replace(signal.name, "noise"): noise,
            }
            model = model.with_effects({signal.sensor: values})
    return model


def logged_options(dataset: Dataset, model: Model) -> dict[str, Any]:
    """Options of the environment as the logs went: limits of the commands, range of the signal."""
    trials = [each.trial for each in dataset.trials]
    options: dict[str, Any] = {"control_rate_hz": RATE_HZ}
    direct = direct_command(model)
    if direct:
        most = max(float(np.nanmax(np.abs(trial.commands[direct]))) for trial in trials)
        options["limits"] = {direct: [-most, most]}
    for signal in model.rig.signals:
        rows = [t.measurements[signal.name] for t in trials if signal.name in t.measurements]
        if rows:
            options["span"] = 0.5 * float(np.nanmax([np.ptp(row[~np.isnan(row)]) for row in rows]))
            return options | {"signal": signal.name}
    raise ValueError("the logs measure none of the rig's signals")


def environments(
    dataset: Dataset, initial_model: str | None, diagnosis: Path
) -> tuple[dict[str, dict[str, Any]], str]:
    """Options of the environments of the amended and the given model, and the signal to follow.

    Where something unknown is missing, the amended model's parameters are drawn as those of a model
    without a fit.

    Args:
        dataset: the logs.
        initial_model: name or file of the model as it was given; that of the data set if None.
        diagnosis: folder of the diagnosis.
    """
    better, uncertainty = amended(diagnosis)
    document = json.loads((diagnosis / "diagnosis.json").read_text(encoding="utf-8"))
    start = with_noise(load_model(initial_model or dataset.model or better), document["floors"])
    options = logged_options(dataset, better)
    signal = options.pop("signal")
    # A fit's covariance says nothing of what no effect carries.
    drawn = Ranges(varied(better)) if document["verdict"] == "unknown" else uncertainty
    return {
        "amended": {**options, "model": better, "randomisation": drawn},
        "given": {**options, "model": start},
    }, signal


def run_from_logs(
    logs: Path,
    initial_model: str | None,
    diagnosis: Path,
    out: Path,
    progress: Progress,
    steps: int = STEPS,
) -> list[Score]:
    """Tune and train on the amended and the given model, and score all on both.

    What is done is kept in the folder, from which the same command goes on.

    Args:
        logs: data set.
        initial_model: name or file of the model as it was given; that of the data set if None.
        diagnosis: folder of the diagnosis.
        out: folder of the results.
        progress: shows how far it is.
        steps: control steps of a policy's training.
    """
    dataset = read_dataset(logs)
    rigs, signal = environments(dataset, initial_model, diagnosis)
    tasks = [f"{signal}_{kind}" for kind in TUNED]
    made: dict[str, tuple[RigController, Mapping[str, Any], Model]] = {}
    for name, options in rigs.items():
        write_text(out / f"{name}.toml", dump_model(options["model"]))
        for controller in (*CONTROLLERS, "policy"):
            one = controller_of(out, controller, name, options, signal, progress, steps)
            made[f"{controller} ({name})"] = *one, options["model"]
    rows = [
        row
        for rig, own in rigs.items()
        for controller, (which, sees, model) in made.items()
        for row in scores(rig, own, {controller: (which, sees)}, tasks, SEEDS, model)
    ]
    sentence = json.loads((diagnosis / "diagnosis.json").read_text(encoding="utf-8"))["sentence"]
    write_report(out, f"Controllers of {dataset.title or logs.name}", rows, sentence)
    return rows


def controller_of(
    out: Path,
    controller: str,
    model: str,
    options: Mapping[str, Any],
    signal: str,
    progress: Progress,
    steps: int,
) -> tuple[RigController, Mapping[str, Any]]:
    """A controller made for an environment, and options that it needs beside that one's.

    Args:
        out: folder that keeps settings and policies.
        controller: its name, or `policy`.
        model: name of the environment's model in names of files.
        options: of the environment.
        signal: what is to follow.
        progress: shows how far it is.
        steps: control steps of a policy's training.
    """
    if controller != "policy":
        tasks = [f"{signal}_{kind}" for kind in TUNED]
        key = f"{controller}-{model}"
        settings = settings_of(out, key, controller, options, tasks, progress)
        return RIG_CONTROLLERS[controller](settings), {}
    file, bar = out / f"policy-{model}.zip", progress.add_task(f"policy, {model}", total=steps)
    train(options, signal, file, lambda done, _: progress.update(bar, completed=done), steps)
    return RigPolicy(file, options), SEES


def settings_of(
    out: Path,
    key: str,
    controller: str,
    options: Mapping[str, Any],
    tasks: Sequence[str],
    progress: Progress,
) -> dict[str, float]:
    """Settings of a controller from the folder, or by a search for this environment."""
    file = out / f"{key}.json"
    digest = hashlib.sha256(repr(sorted(options.items())).encode()).hexdigest()[:16]
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    if kept.get("environment") != digest:
        bar = progress.add_task(key, total=None)
        settings = tuned(
            controller,
            options,
            tasks,
            lambda n, total: progress.update(bar, completed=n, total=total),
        )
        kept = {"environment": digest, "settings": settings}
        write_text(file, json.dumps(kept) + "\n")
    return kept["settings"]


def write_report(out: Path, title: str, rows: Sequence[Score], said: str = "") -> None:
    """Write `scores.csv` and `report.html`, and print the table."""
    table = score_table(rows)
    write_text(out / "scores.csv", csv_text([Score._fields, *rows]))
    blocks: list[Block] = [Heading(title, 1), *([Paragraph(said)] if said else []), table]
    write_text(out / "report.html", to_html(blocks, {}))
    print_table(table)
