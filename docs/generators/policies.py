"""Results of trained policies, from the figures that were kept of the study."""

import json
from pathlib import Path
from typing import Any

from benchmarks.training.study.operators import table_of
from benchmarks.training.study.tables import (
    ablation_table,
    judged_table,
    robustness_table,
    training_table,
)
from controllers.policies.policy_file import load_policy_file
from controllers.policy import POLICIES, shipped_policies
from generators.text import code, table
from pma_gym.pages.document import TextTable, to_markdown

FIGURES = Path(__file__).parents[1] / "figures" / "policies.json"


def _read() -> dict[str, Any]:
    return json.loads(FIGURES.read_text("utf-8"))


def _written(table: TextTable) -> str:
    return to_markdown([table], {}, "")


def policies_judged(group: str) -> str:
    """A group's pooled errors on the suites."""
    return _written(judged_table(_read()["groups"][group]))


def policies_trained() -> str:
    """What trainings took and reached."""
    figures = _read()
    return _written(training_table(figures, figures["pid"]))


def policies_ablations() -> str:
    """What each piece of knowledge is worth."""
    return _written(ablation_table(_read()))


def policies_robustness(task: str) -> str:
    """Errors under conditions that were not trained with."""
    return _written(robustness_table(_read(), task))


def policies_operators(name: str) -> str:
    """Errors of a shipped policy over an exercise's operators, beside constant pressure."""
    policy = load_policy_file(POLICIES / f"{name}.json")
    return "\n".join(table_of(policy.training["scores"]["operators"]))


def policies_shipped() -> str:
    """The policies that ship."""
    rows = []
    for path in shipped_policies():
        policy = load_policy_file(path)
        training = policy.training
        validation = training["scores"]["validation"]
        size = sum(p.stat().st_size for p in (path, path.with_suffix(".safetensors"))) / 1024
        rows.append(
            [
                code(policy.name),
                training["preset"],
                f"{training['seed']}",
                f"{training['steps'] / 1e6:.2g}",
                f"{validation['error']:.3g} {validation['unit']}",
                f"{size:.0f}",
            ]
        )
    header = ["Policy", "Preset", "Seed", "Steps (10^6)", "Validation", "KiB"]
    return table(header, rows, (2, 3, 4, 5))
