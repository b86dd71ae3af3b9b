"""The two parts of an RMSE, measured and simulated: what its line misses, and what is about it."""

from statistics import fmean

from benchmarks.reproduction.results import Results
from benchmarks.reproduction.tables import MISSING, RULE
from benchmarks.runner.phase_score import UNITS, PhaseScore, measured_score
from pma_gym.pages.document import Paragraph, TextTable

PARTS = ("rmse", "line_error", "scatter")
"""Attributes of a `PhaseScore`: RMSE^2 = line_error^2 + scatter^2."""

_NAMES = ("RMSE", "line part", "scatter")


def parts_table(results: Results, task: str, phase: str) -> TextTable:
    """RMSE, its part in the regression line and its part about it, measured and replayed."""
    unit, replay = UNITS[task], results.suite.goals.replay
    pressures = results.suite.pressures_kpa[task]
    measured = [measured_score(task, phase, pressure) for pressure in pressures]
    model = results.suite.models[0]
    simulated = [results.phase(model, replay, task, pressure, phase) for pressure in pressures]
    rows = [
        [f"{pressure:g}", *_cells(mine), *_cells(theirs)]
        for pressure, mine, theirs in zip(pressures, measured, simulated, strict=True)
    ]
    known = [score for score in simulated if score is not None]
    means = ["mean", *_means(measured), *(_means(known) if known else [""] * len(PARTS))]
    header = ["Pressure (kPa)"]
    header += [f"{who} | {name} ({unit})" for who in ("Measured", "Simulated") for name in _NAMES]
    part = "Displacement" if task == phase else f"Rotation, phase {phase}"
    return TextTable(f"{part}: the two parts of the RMSE", header, [*rows, RULE, means])


def parts_explained() -> Paragraph:
    """Explain the two parts of the RMSE."""
    return Paragraph(
        "An RMSE against the ideal has two parts: the line part, the root mean square over the "
        "trial of its regression line less the ideal, and the scatter, the root mean square about "
        "that line. RMSE² = line part² + scatter². Tables 20-22 and 24-30 give both for every "
        "measured trial. A simulation with too little scatter can have the measured RMSE only with "
        "a line that is wrong; the two parts show that."
    )


def _cells(score: PhaseScore | None) -> list[str]:
    if score is None:
        return [MISSING, "", ""]
    return [f"{getattr(score, name):.3f}" for name in PARTS]


def _means(scores: list[PhaseScore]) -> list[str]:
    return [f"{fmean(getattr(score, name) for score in scores):.3f}" for name in PARTS]
