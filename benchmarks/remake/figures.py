"""Figures of the station and of all that depends on it, as they stand in files: old beside new."""

import csv
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import fmean

from benchmarks.runner.fingerprint import ROOT
from benchmarks.suites.frozen import suite_names
from pma_gym.plant.model import ModelError, load_model

Figures = dict[str, float]


def figures(root: Path = ROOT) -> Figures:
    """All figures that there are, by name; those of a job that has not run are not among them."""
    return dict([*_model(), *_reproduction(root), *_suites(root), *_policies(root)])


def _model() -> Iterator[tuple[str, float]]:
    try:
        model = load_model("station")
    except ModelError:
        return
    for path, note in model.notes.items():
        effect, _, file_key = path.partition(".")
        value = model.values_in_files(effect)[file_key]
        if note.low is not None and isinstance(value, float):
            yield f"station: {path}", value


def _reproduction(root: Path) -> Iterator[tuple[str, float]]:
    """Mean RMSE by controller and phase, and the replay's mean absolute errors."""
    path = root / "results" / "reproduction" / "scores.json"
    if not path.is_file():
        return
    run = json.loads(path.read_text(encoding="utf-8"))
    values: dict[str, list[float]] = {}
    for score in run["scores"]:
        if score["model"] != run["suite"]["models"][0]:
            continue
        for phase, figures in score["phases"].items():
            name = f"{score['controller']}, {score['task']} {phase}: RMSE ({score['unit']})"
            values.setdefault(name, []).append(figures["rmse"])
    for error in run.get("replay_errors", []):
        for quantity in ("slope", "intercept", "mean", "rmse", "line_error", "scatter"):
            if quantity in error:
                name = f"replay, {error['task']} {error['phase']}: error of {quantity}"
                values.setdefault(name, []).append(abs(error[quantity]))
    yield from ((f"reproduction: {name}", fmean(each)) for name, each in values.items())


def _suites(root: Path) -> Iterator[tuple[str, float]]:
    """Interquartile means of the leaderboards."""
    for suite in suite_names():
        path = root / "results" / suite / "leaderboard.csv"
        if not path.is_file():
            continue
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                if row["mean"]:
                    name = f"{suite}: {row['controller']}, {row['measure']} ({row['unit']})"
                    yield name, float(row["mean"])


def _policies(root: Path) -> Iterator[tuple[str, float]]:
    """Validation errors of the policies that ship."""
    for path in sorted((root / "controllers" / "policies" / "shipped").glob("*.json")):
        scores = json.loads(path.read_text(encoding="utf-8"))["training"]["scores"]
        validation = scores.get("validation")
        if validation:
            yield (
                f"policy {path.stem}: validation ({validation['unit']})",
                float(validation["error"]),
            )


def compared(old: Mapping[str, float], new: Mapping[str, float]) -> list[tuple[str, str, str, str]]:
    """Return rows of name, old, new and change in percent, for changed and new figures."""
    rows = []
    for name in dict.fromkeys([*old, *new]):
        before, after = old.get(name), new.get(name)
        if before == after:
            continue
        change = ""
        if before and after is not None:
            change = f"{100.0 * (after / before - 1.0):+.1f} %"
        rows.append((name, _text(before), _text(after), change))
    return rows


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
