"""Results of a study, as one JSON document: pooled errors, seeds, curves, what is left out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.report.statistics import interquartile_mean
from benchmarks.runner.journal import JOURNAL, case_rows
from benchmarks.training.study.cells import Cell, cells
from benchmarks.training.study.pooled import Pool
from benchmarks.training.study.scored_policies import PID_FOLDER, SUITES, pools, seed_folders
from benchmarks.training.validation import measure_of
from controllers.policies.policy_file import PolicyFile, load_policy_file


def study_figures(out: Path) -> dict[str, Any]:
    """All figures of a study that has been run and judged.

    Args:
        out: its folder.
    """
    groups: dict[str, list[Cell]] = {}
    for cell in cells():
        groups.setdefault(cell.group, []).append(cell)
    return {
        "groups": {
            name: _group(out / name, members)
            for name, members in groups.items()
            if seed_folders(out / name)
        }
    }


def pid_errors(out: Path) -> dict[str, float]:
    """The PID's interquartile mean in suite `robust` by kind of task (mm, deg)."""
    pid = pools(out / PID_FOLDER, "robust", ["pid"])
    return {
        kind: float(pid[measure_of(kind).name].by_seed[0]) for kind in ("displacement", "rotation")
    }


def _group(folder: Path, members: list[Cell]) -> dict[str, Any]:
    seeds = seed_folders(folder)
    first = members[0]
    names = [f"{seed.name}-{first.algorithm}" for seed in seeds]
    judged: dict[str, Any] = {}
    smooth: dict[str, Any] = {}
    for suite in SUITES:
        results = folder / f"suite-{suite}"
        if results.is_dir():
            judged[suite] = {
                measure: _pooled(pool) for measure, pool in pools(results, suite, names).items()
            }
            smooth[suite] = variation(results)
    policies = {
        path.stem: [
            load_policy_file(seed / path.name) for seed in seeds if (seed / path.name).exists()
        ]
        for path in sorted(seeds[0].glob("*.json"))
    }
    return {
        "title": first.title,
        "algorithm": first.algorithm,
        "code": sorted({file.training["code"] for files in policies.values() for file in files}),
        "seeds": len(seeds),
        "judged": judged,
        "variation_v_per_s": smooth,
        "trained": {name: _trained(files) for name, files in policies.items()},
    }


def variation(results: Path) -> dict[str, float]:
    """Median total variation of the voltage a second (V/s) by task, in a run's cases."""
    by_task: dict[str, list[float]] = {}
    for row in case_rows(results / JOURNAL):
        if not row["failure"]:
            by_task.setdefault(row["task"], []).append(row["variation_v_per_s"])
    return {task: float(np.median(values)) for task, values in by_task.items()}


def _pooled(pool: Pool) -> dict[str, Any]:
    return {
        "unit": pool.errors.measure.unit,
        "mean": list(pool.mean),
        "by_seed": [float(one) for one in pool.by_seed],
        "reliable": pool.reliable,
        "cases": len(pool.errors.episodes),
    }


def _trained(files: list[PolicyFile]) -> dict[str, Any]:
    """Steps, wall time and learning curves of trainings that differ in their seed."""
    training = [file.training for file in files]
    curves = [np.array(one["curve"]) for one in training]
    return {
        "seeds": [one["seed"] for one in training],
        "steps": training[0]["steps"],
        "wall_s": [one["wall_s"] for one in training],
        "validation": [one["scores"]["validation"]["error"] for one in training],
        "unit": training[0]["scores"]["validation"]["unit"],
        "curve": _curve(curves),
    }


def _curve(curves: list[Any]) -> dict[str, list[float]]:
    """Interquartile mean over the seeds at every validation, with its interval over the seeds."""
    length = min(map(len, curves))
    errors = np.array([curve[:length, 2] for curve in curves])
    middle, low, high = [], [], []
    generator = np.random.default_rng(0)
    drawn = generator.integers(len(errors), size=(2000, len(errors)))
    for column in errors.T:
        means = np.asarray(interquartile_mean(column[drawn]))
        middle.append(float(interquartile_mean(column)))
        low.append(float(np.quantile(means, 0.025)))
        high.append(float(np.quantile(means, 0.975)))
    return {
        "steps": np.mean([curve[:length, 0] for curve in curves], axis=0).tolist(),
        "wall_s": np.mean([curve[:length, 1] for curve in curves], axis=0).tolist(),
        "error": middle,
        "low": low,
        "high": high,
    }


def reached(curve: Mapping[str, list[float]], error: float) -> float | None:
    """Wall time at which a curve first is below an error (s); None if it never is."""
    for seconds, value in zip(curve["wall_s"], curve["error"], strict=True):
        if value < error:
            return seconds
    return None
