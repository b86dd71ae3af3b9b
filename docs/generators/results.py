"""Kept figures of the diagnosis; the exercise device's tables and the shipped policies."""

import json
from pathlib import Path
from typing import Any

from benchmarks.exercise.choose_device import Choice
from benchmarks.exercise.safety_episodes import Safety
from benchmarks.exercise.safety_layer import read_safety, safety_table, safety_text
from benchmarks.exercise.tables import check_table, knee_table, makers_table, range_table
from benchmarks.hidden_effects.evaluation.records import measured_text
from benchmarks.hidden_effects.evaluation.summary import diagnosis, measured_in, report_blocks
from controllers.policies.policy_file import load_policy_file
from controllers.policy import shipped_policies
from generators.text import code, table
from pma_gym.pages.document import TextTable, to_markdown
from pma_gym.plant.model import load_model
from pma_gym.studies.moment_ranges import check_moments
from pma_gym.tasks import OPERATOR_BOUNDS, PACED, PACING, Operator, Population

FIGURES = Path(__file__).parents[1] / "figures"


def _read(name: str) -> dict[str, Any]:
    return json.loads((FIGURES / f"{name}.json").read_text("utf-8"))


def hidden_rates() -> str:
    """Every figure with its target, block by block."""
    every = report_blocks(_read("hidden-effects"))
    tables = [each for each in every if isinstance(each, TextTable)]
    return to_markdown(tables[:1], {}, "") + _measured()


def hidden_summary() -> str:
    """The rate of each block that says most."""
    return diagnosis()


def hidden_table(block: str, *title: str) -> str:
    """The table of a block whose title begins so, as the report has it."""
    document = _read("hidden-effects")
    alone = {**document, "blocks": {block: document["blocks"][block]}}
    tables = [
        each
        for each in report_blocks(alone)
        if isinstance(each, TextTable) and each.title.startswith(" ".join(title))
    ]
    return to_markdown(tables, {}, "") + _measured(block)


def _measured(*names: str) -> str:
    """A sentence on what blocks were measured with, all if none is named."""
    blocks = _read("hidden-effects")["blocks"]
    return "\n" + measured_text(measured_in({name: blocks[name] for name in names or blocks}))


def hidden_measured(*some: str) -> str:
    """The same sentence for figures that a page has in its text.

    Args:
        some: COMMIT/DATE/METHOD of each measurement; METHOD is the digest.
    """
    names = ("commit", "date", "method")
    return measured_text(dict(zip(names, each.split("/"), strict=True)) for each in some)


def hidden_seconds() -> str:
    """How long a diagnosis took on one core, by block."""
    blocks = _read("hidden-effects")["blocks"]
    times = {name: each["seconds"] for name, each in blocks.items()}
    rows = [
        [code(name), blocks[name]["n"], f"{each['median']:.1f}", f"{each['most']:.0f}"]
        for name, each in times.items()
    ]
    return table(["Block", "Cases", "Median (s)", "Most (s)"], rows, (1, 2, 3)) + "\n" + _measured()


def hidden_confused() -> str:
    """What was taken for what, in the blocks that hide one effect, and how often."""
    blocks = _read("hidden-effects")["blocks"]
    counts: dict[tuple[str, str], list[int]] = {}
    shown = ("single", "faint")
    for place, block in enumerate(shown):
        for hidden, said in blocks[block]["confusion"].items():
            for other, number in said.items():
                if other != hidden:
                    counts.setdefault((hidden, other), [0, 0])[place] += number
    rows = [[code(hidden), code(said), *each] for (hidden, said), each in sorted(counts.items())]
    header = ["Hidden", "Said", *(code(each) for each in shown)]
    return table(header, rows, (2, 3)) + "\n" + _measured(*shown)


def hidden_misses() -> str:
    """Every case in which the diagnosis did not say what it should."""
    rows = [
        [name, miss["number"], miss["hidden"], "" if miss["r"] is None else f"{miss['r']:.2f}"]
        + [miss["said"]]
        for name, block in _read("hidden-effects")["blocks"].items()
        for miss in block["misses"]
    ]
    return table(["Block", "Case", "Hidden", "r", "Said"], rows, (1, 3)) + "\n" + _measured()


def exercise_check() -> str:
    """The tested muscle's moment at 90 deg beside tables I3 and 23."""
    return _markdown(check_table(load_model("station")))


def exercise_worst() -> str:
    """The largest difference from table I3, as a sentence."""
    worst = max(check_moments(load_model("station")), key=lambda check: abs(check.percent))
    return (
        f"The largest difference is {abs(worst.percent):.1f} %, at {1e-3 * worst.pressure:g} kPa; "
        "10 % is the target, and nothing was tuned for it."
    )


def exercise_ranges() -> str:
    """Ranges of moments by configuration."""
    model = load_model("station")
    return _markdown(range_table(model, Choice().shown(model)))


def exercise_knee() -> str:
    """A young adult's knee over the angle."""
    return _markdown(knee_table(load_model("station")))


def exercise_makers() -> str:
    """Makers' figures beside the scaled ones."""
    return _markdown(makers_table(load_model("station")))


def exercise_people() -> str:
    """What operators are drawn from, in the two sorts of exercise."""
    rows = [
        [name, *(_between(people, name) for people in (PACED, PACING)), OPERATOR_BOUNDS[name][2]]
        for name in Operator._fields
        if name != "tremor_phase"
    ]
    return table(["Of the operator", "Speed prescribed", "Moment prescribed", "Unit"], rows)


def _between(people: Population, name: str) -> str:
    low, high = getattr(people.low, name), getattr(people.high, name)
    return f"{low:.3g}" if low == high else f"{low:.3g}-{high:.3g}"


def exercise_safety() -> str:
    """How often wild commands hurt, with the safety layer and without."""
    return _markdown(safety_table(_safety()))


def exercise_safety_text() -> str:
    """The same in a sentence."""
    return safety_text(_safety())


def _safety() -> Safety:
    return read_safety(Path(__file__).parents[1] / "figures" / "exercise-safety.json")


def _markdown(table: TextTable) -> str:
    return to_markdown([table], {}, "").strip()


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
    return table(
        ["Policy", "Preset", "Seed", "Steps (10^6)", "Validation", "KiB"], rows, (2, 3, 4, 5)
    )
