"""Kept figures of the diagnosis; the exercise device's tables and the shipped policies."""

from pathlib import Path

from benchmarks.exercise.choose_device import Choice
from benchmarks.exercise.safety_episodes import Safety
from benchmarks.exercise.safety_layer import read_safety, safety_table, safety_text
from benchmarks.exercise.tables import check_table, knee_table, makers_table, range_table
from benchmarks.hidden_effects.evaluation.records import measured_text
from benchmarks.hidden_effects.evaluation.summary import diagnosis
from controllers.policies.policy_file import load_policy_file
from controllers.policy import shipped_policies
from generators.text import code, table
from pma_gym.pages.document import TextTable, to_markdown
from pma_gym.plant.model import load_model
from pma_gym.studies.moment_ranges import check_moments
from pma_gym.tasks import OPERATOR_BOUNDS, PACED, PACING, Operator, Population


def hidden_summary() -> str:
    """The rate of each block that says most."""
    return diagnosis()


def hidden_measured(*some: str) -> str:
    """By which commits figures were measured that a page has in its text.

    Args:
        some: COMMIT/DATE/METHOD of each measurement; METHOD is the digest.
    """
    names = ("commit", "date", "method")
    return measured_text(dict(zip(names, each.split("/"), strict=True)) for each in some)


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
