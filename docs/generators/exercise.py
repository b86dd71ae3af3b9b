"""The exercise device's tables, computed as the page is rendered."""

from benchmarks.exercise.choice import Choice
from benchmarks.exercise.tables import check_table, knee_table, makers_table, range_table
from pma_gym.pages.document import TextTable, to_markdown
from pma_gym.plant.model import load_model
from pma_gym.studies.moment_ranges import check_moments


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


def _markdown(table: TextTable) -> str:
    return to_markdown([table], {}, "").strip()
