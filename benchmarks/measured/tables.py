"""Results of the job, as rows of text: for the terminal and for the page."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.measured.rounds import Round
from benchmarks.measured.steps import Step


@dataclass(frozen=True)
class Measured:
    """Result of the job.

    Attributes:
        rounds: the diagnoses.
        steps: models with one effect more at a time.
        folds: rms errors of all effects with every pressure left out once, by figure.
        floors: scatter between repeats, by figure.
        seconds: how long this run took (s), without stages kept from an earlier one.
        settings: what was diagnosed, and how many stages which code made.
    """

    rounds: list[Round]
    steps: list[Step]
    folds: dict[str, float]
    floors: dict[str, float]
    seconds: float
    settings: dict[str, Any]


TARGET_MM = 1.0
"""Extension that is aimed at, on pressures that took no part (mm)."""

COLUMNS = (
    ("extension_mm", "extension (mm)"),
    ("extension_at_load_mm", "at measured load (mm)"),
    ("rotation_deg", "rotation (deg)"),
    ("return_mm", "return (mm)"),
    ("return_deg", "return rotation (deg)"),
)
"""Figures and their headings."""

Rows = list[tuple[str, ...]]


def readable(name: str) -> str:
    """An effect's name in words."""
    return name.replace("_", " ")


def round_rows(rounds: Sequence[Round]) -> Rows:
    """Each diagnosis: verdict, what it added, and with what that may be confused."""
    rows = []
    for number, each in enumerate(rounds, 1):
        if not each.effects:
            rows.append((str(number), str(each.trials), each.verdict, "nothing", "", ""))
        for name in each.effects:
            others = ", ".join(map(readable, equals(each, name)))
            chance = f"{each.p_values[name]:.2g}" if name in each.p_values else ""
            rows.append(
                (str(number), str(each.trials), each.verdict, readable(name), chance, others)
            )
    return rows


def equals(one: Round, name: str) -> list[str]:
    """Effects that explain a round's trials as well as one that it added."""
    reason = f"explains these data as well as {name}"
    return [other for other, _, _, why in one.rivals if why == reason]


def error_rows(result: Measured) -> Rows:
    """Errors on pressures that took no part, model after model, and what they may be held to."""
    rows = [
        (_label(step.name), *(f"{step.unseen[key]:.2f}" for key, _ in COLUMNS))
        for step in result.steps
    ]
    every = tuple(f"{result.folds[key]:.2f}" for key, _ in COLUMNS)
    rows.append(("all effects, every pressure left out once", *every))
    rows.append(("scatter of the repeats", *(f"{result.floors[key]:.2f}" for key, _ in COLUMNS)))
    return rows


def replay_rows(result: Measured, phase: str) -> Rows:
    """Errors of the replay in a phase, model after model."""
    return [
        (
            _label(step.name),
            *(_figure(entry, key) for key in ("slope", "intercept", "mean", "mean_signed", "rmse")),
            f"{entry['trials']}",
        )
        for step in result.steps
        for entry in step.replay
        if entry["phase"] == phase
    ]


REPLAY_HEADER = ("model", "slope", "intercept", "mean", "mean, signed", "RMSE", "trials")


def experiment_text(result: Measured) -> list[str]:
    """Describe the next experiment."""
    paragraphs = []
    for number, each in enumerate(result.rounds, 1):
        following = each.next_experiment
        if following is not None:
            names = [readable(name) for name in following["separates"]]
            why = f"tell {' and '.join(names)} apart"
            if len(names) == 1:
                why = f"see whether {names[0]} is there"
            paragraphs.append(f"Round {number} proposes, to {why}: {following['excitation']}.")
    return paragraphs


def verdict_text(result: Measured) -> Iterator[str]:
    """Describe the targets and the results."""
    first, last = result.steps[0], result.steps[-1]
    got = last.unseen["extension_mm"]
    met = "met" if got <= TARGET_MM else "MISSED"
    yield (
        f"Extension at pressures that took no part: {first.unseen['extension_mm']:.2f} mm as "
        f"given, {got:.2f} mm with {len(last.effects)} effects; target {TARGET_MM:g} mm: {met}; "
        f"repeats scatter by {result.floors['extension_mm']:.2f} mm."
    )
    yield (
        f"Rotation: {first.unseen['rotation_deg']:.2f} deg as given, "
        f"{last.unseen['rotation_deg']:.2f} deg; repeats {result.floors['rotation_deg']:.2f} deg."
    )
    yield f"This run took {result.seconds:.0f} s; stages kept from an earlier one are not counted."


def _label(name: str) -> str:
    return name if name in ("as given", "parameters refitted") else f"+ {readable(name)}"


def _figure(entry: Any, key: str) -> str:  # noqa: ANN401
    return f"{float(entry[key]):.2f}"
