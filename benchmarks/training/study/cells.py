"""Trainings of a study: algorithms, loops and tasks, and ablations."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from benchmarks.training.configuration.preset import Preset, load_preset
from benchmarks.training.job import ENVIRONMENT_OF
from controllers.policies.action_mapping import MIDDLE_V, ActionMapping

HEADLINE = "ppo"
"""Algorithm with the most seeds."""

HEADLINE_PRESETS = {
    "increment": "PPO",
    "increment-late": "PPO",
}
"""Presets of the headline algorithm, and what reports call its policies."""

EXERCISE_PRESET, EXERCISE_TASK = "increment", "isokinetic_exercise"
"""The headline algorithm's preset for an exercise, and the exercise that is studied."""

OFF_POLICY = ("sac", "td3", "tqc")
"""Algorithms that learn from what is past, over and over."""

HEADLINE_SEEDS, OTHER_SEEDS = 10, 5
"""Training seeds of the headline algorithm and of everything else."""

ABLATION_STEPS = 1_000_000
"""Control steps of the trainings that leave something out, and of their like with all of it."""


class Cell(NamedTuple):
    """Trainings that differ only in their seed.

    Attributes:
        group: what results call it; a folder.
        title: what reports call it.
        algorithm: one of `ALGORITHMS`.
        preset: name of the preset.
        task: name of the task.
        seeds: how many.
        change: what is changed of the preset; "" for nothing.
        steps: control steps; 0 for the preset's.
    """

    group: str
    title: str
    algorithm: str
    preset: str
    task: str
    seeds: int
    change: str = ""
    steps: int = 0

    @property
    def resolved(self) -> Preset:
        """The preset as it is trained."""
        preset = load_preset(self.preset, self.algorithm, ENVIRONMENT_OF[self.task])
        if self.steps:
            preset = preset.changed(steps=self.steps)
        return CHANGES[self.change](preset) if self.change else preset


CHANGES: dict[str, Callable[[Preset], Preset]] = {
    "no preview": lambda p: p.changed(view=replace(p.view, preview=0)),
    "no history": lambda p: p.changed(view=replace(p.view, history=0)),
    "no randomisation": lambda p: p.changed(stations=""),
    "no averaging": lambda p: p.changed(average_share=0.0),
    "direct form": lambda p: p.changed(form=ActionMapping("direct", MIDDLE_V)),
}
"""What may be changed of a preset, by name."""


def cells() -> list[Cell]:
    """All of the study, what others build on first."""
    every = []
    for preset, title in HEADLINE_PRESETS.items():
        for task in ("displacement", "rotation"):
            group = f"{HEADLINE}-{preset}"
            every.append(Cell(group, title, HEADLINE, preset, task, HEADLINE_SEEDS))
    group = f"{HEADLINE}-{EXERCISE_PRESET}"
    title = HEADLINE_PRESETS[EXERCISE_PRESET]
    every.append(Cell(group, title, HEADLINE, EXERCISE_PRESET, EXERCISE_TASK, HEADLINE_SEEDS))
    for algorithm in OFF_POLICY:
        title = f"{algorithm.upper()}, residual"
        for task in ("displacement", "rotation", EXERCISE_TASK):
            group = residual_group(algorithm)
            every.append(Cell(group, title, algorithm, "residual", task, OTHER_SEEDS))
    for algorithm in OFF_POLICY:
        group, title = f"{algorithm}-increment", algorithm.upper()
        every.append(Cell(group, title, algorithm, "increment", "displacement", OTHER_SEEDS))
    every += ablations("displacement")
    return every


def residual_group(algorithm: str) -> str:
    """Group of the trainings of an algorithm that add to a classical controller."""
    return f"{algorithm}-residual"


def ablations(task: str) -> list[Cell]:
    """The headline's training, shorter, with all knowledge and with each piece left out."""

    def cell(name: str, title: str, preset: str = "increment", change: str = "") -> Cell:
        group = f"ablation-{name}"
        return Cell(group, title, HEADLINE, preset, task, OTHER_SEEDS, change, ABLATION_STEPS)

    return [
        cell("whole", "all of it"),
        cell("preview", "no preview", change="no preview"),
        cell("history", "no history", change="no history"),
        cell("randomisation", "nominal station alone", change="no randomisation"),
        cell("averaging", "weights not averaged", change="no averaging"),
        cell("direct", "voltage in place of its change", change="direct form"),
        cell("residual", "residual on feed-forward + PID", "residual"),
        cell("plain", "the environment's own observation, voltage", "plain"),
    ]
