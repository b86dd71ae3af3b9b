"""Tables of a study's figures, as the documentation and README print them."""

from collections.abc import Mapping
from typing import Any

from benchmarks.training.study.figures import reached
from pma_gym.pages.document import TextTable
from pma_gym.tasks import EVERY_TASK

SHOWN = ("displacement", "unseen displacement", "rotation I, II", "rotation III", "unseen rotation")
"""Measures that are printed, where they are there."""


def judged_table(group: Mapping[str, Any]) -> TextTable:
    """Pooled interquartile means of a group by suite and measure, and how the seeds spread."""
    rows = []
    for suite, measures in group["judged"].items():
        for measure, pooled in measures.items():
            estimate, low, high = pooled["mean"]
            seeds = pooled["by_seed"]
            rows.append(
                [
                    suite,
                    f"{measure} ({pooled['unit']})",
                    f"{estimate:.3g}",
                    f"[{low:.3g}, {high:.3g}]",
                    f"{min(seeds):.3g}",
                    f"{max(seeds):.3g}",
                    f"{pooled['reliable']} of {len(seeds)}",
                ]
            )
    header = [
        "Suite",
        "Measure",
        "Mean of all seeds",
        "95 %",
        "Best seed",
        "Worst",
        "Within twice the best",
    ]
    return TextTable("Policies on the suites", header, rows, words=2)


def training_table(figures: Mapping[str, Any], limits: Mapping[str, float]) -> TextTable:
    """What trainings took and reached on validation stations.

    Args:
        figures: of the study.
        limits: error by kind of task (mm, deg) of which it is said when a curve is below it.
    """
    rows = []
    for group in figures["groups"].values():
        for name, trained in group["trained"].items():
            kind = name.partition("-")[0]
            errors, walls = trained["validation"], trained["wall_s"]
            below = ""
            if kind in limits and "delay" not in name:
                when = reached(trained["curve"], limits[kind])
                below = "never" if when is None else f"{when:.0f}"
            rows.append(
                [
                    f"{group['title']}: {name.rpartition('-')[0]}",
                    f"{len(errors)}",
                    f"{trained['steps'] / 1e6:.2g}",
                    f"{sum(walls) / len(walls):.0f}",
                    f"{min(errors):.3g} to {max(errors):.3g} {trained['unit']}",
                    below,
                ]
            )
    header = [
        "Training",
        "Seeds",
        "Steps (10^6)",
        "Wall time (s)",
        "Validation",
        "Below PID after (s)",
    ]
    return TextTable("Trainings", header, rows)


def ablation_table(figures: Mapping[str, Any]) -> TextTable:
    """What each piece of knowledge is worth: validation errors of equally short trainings."""
    rows = []
    for name, group in figures["groups"].items():
        if not name.startswith("ablation-"):
            continue
        (trained,) = group["trained"].values()
        errors = sorted(trained["validation"])
        middle = errors[len(errors) // 2]
        rows.append([group["title"], f"{middle:.3g}", f"{errors[0]:.3g} to {errors[-1]:.3g}"])
    return TextTable("What helps", ["Training", "Median (mm)", "All seeds (mm)"], rows)


def robustness_table(figures: Mapping[str, Any], task: str) -> TextTable:
    """Errors under conditions that were not trained with, beside classical controllers."""
    conditions = figures["robustness"][task]
    names = list(next(iter(conditions.values())))
    rows = [
        [condition, *(f"{errors[name]:.3g}" for name in names)]
        for condition, errors in conditions.items()
    ]
    unit = EVERY_TASK[task].schedule.unit
    return TextTable(f"{task} ({unit})", ["Condition", *names], rows)
