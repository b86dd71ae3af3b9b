"""The report's words on measured against simulated: computed from the errors, never assumed."""

from collections.abc import Sequence
from statistics import fmean

from benchmarks.reproduction.plots import replay_figure
from benchmarks.reproduction.replay import ReplayError, all_replay_errors, summarise, table_angle
from benchmarks.reproduction.results import Results
from benchmarks.reproduction.tables import MISSING, RULE, replay_table
from benchmarks.runner.phase_score import UNITS, PhaseScore, measured_score
from pma_gym.pages.document import Block, Heading, Paragraph, TextTable
from pma_gym.plant.model import shipped_models

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
    header = [
        "Pressure (kPa)",
        *(f"{who} | {name} ({unit})" for who in ("Measured", "Simulated") for name in _NAMES),
    ]
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


_UNITS = {"slope": "mm/s", "intercept": "mm", "rmse": "mm"}
_MEASURES = {"slope": "slope", "intercept": "intercept", "rmse": "RMSE"}


def replay_blocks(results: Results) -> list[Block]:
    """Errors of the replay on the first model, trial by trial, and what they amount to."""
    model = results.suite.models[0]
    errors = all_replay_errors(results, model)
    if not errors:
        return []
    blocks: list[Block] = [
        Heading("Measured against simulated: the replay"),
        Paragraph(
            f"The dissertation's printed voltages drive `{model}`; what comes out is compared "
            f"with what the real station did. Errors are simulated less measured. {_origin(model)}"
        ),
        replay_figure(results),
    ]
    displacement = errors.get(("displacement", "displacement"))
    if displacement:
        blocks += [_against_simple_prediction(results, displacement)]
        blocks += [Paragraph(displacement_verdict(results, displacement))]
    for (task, phase), trials in errors.items():
        blocks += [replay_table(trials), parts_table(results, task, phase)]
    blocks.append(parts_explained())
    phase_errors = errors.get(("rotation", "II"))
    if phase_errors:
        blocks += _hold_blocks(results, phase_errors)
    return blocks


def _origin(model: str) -> str:
    """Where the parameters of a shipped model come from; nothing is known of another."""
    if model not in shipped_models():
        return ""
    return (
        "The model's parameters come from other tables of the dissertation, never from these "
        "trials: this is a prediction."
    )


def displacement_verdict(results: Results, errors: Sequence[ReplayError]) -> str:
    """State whether the model predicts displacement better than the simple prediction."""
    line = results.suite.goals.simple_prediction
    got = summarise(errors).absolute
    better = [_MEASURES[name] for name in _MEASURES if got[name] < line[name]]
    worse = [_MEASURES[name] for name in _MEASURES if got[name] >= line[name]]
    if not worse:
        return "**The model predicts all three figures better than the simple prediction.**"
    if not better:
        return "**The model predicts none of the three figures better than the simple prediction.**"
    return (
        f"**The model predicts the {' and the '.join(better)} better than the simple "
        f"prediction, the {' and the '.join(worse)} not.**"
    )


def _against_simple_prediction(results: Results, errors: Sequence[ReplayError]) -> TextTable:
    """Mean absolute errors over the displacement trials beside the line to beat."""
    line = results.suite.goals.simple_prediction
    means = summarise(errors)
    rows = [
        [
            f"{_MEASURES[name]} ({unit})",
            f"{means.signed[name]:+.3f}",
            f"{means.absolute[name]:.3f}",
            f"{line[name]:.2f}",
            f"{100.0 * (means.absolute[name] / line[name] - 1.0):+.0f} %",
        ]
        for name, unit in _UNITS.items()
    ]
    return TextTable(
        f"Displacement, {means.trials} trials, beside the simple prediction "
        "(table I3 read at the printed voltages, lagged by 2.90/K)",
        ["", "Mean error", "Mean absolute error", "Simple prediction", "Difference"],
        rows,
    )


def _hold_blocks(results: Results, errors: Sequence[ReplayError]) -> list[Block]:
    """Phase II beside what the dissertation's own table I3 has for the same voltages."""
    rows, table_errors = [], []
    for error in errors:
        measured = measured_score("rotation", "II", error.pressure_kpa).mean
        angle, extrapolated = table_angle(error.pressure_kpa)
        table_errors.append(angle - measured)
        rows.append(
            [
                f"{error.pressure_kpa:g}",
                f"{measured:.1f}",
                f"{measured + error.mean:.1f}",
                f"{angle:.1f}{'*' if extrapolated else ''}",
                f"{error.mean:+.1f}",
                f"{angle - measured:+.1f}",
            ]
        )
    header = [
        "Pressure (kPa)",
        "Measured (deg)",
        "Simulated (deg)",
        "Table I3 (deg)",
        "Simulated less measured",
        "I3 less measured",
    ]
    title = "Rotation held in phase II: mean angle (* beyond the table's 8.45 V, drawn on)"
    simulated = fmean(error.mean for error in errors)
    tabled = fmean(table_errors)
    text = (
        f"Why rotation comes out {'too far' if simulated > 0.0 else 'too short'}: the printed "
        "voltages were computed for a pulley on which 90 deg are 45 mm (radius 28.65 mm), while "
        "the station's own table I3 shows a "
        "radius of about 25.4 mm. Read at the voltages of the hold, with nothing simulated, table "
        f"I3 lies {tabled:+.1f} deg from the angles measured in the trials on average; the "
        f"simulated station lies {simulated:+.1f} deg from them. So the model is "
        f"{simulated - tabled:+.1f} deg from the table that it was identified on, and the rest is "
        "how far the dissertation's two experiments disagree with each other."
    )
    return [Paragraph(text), TextTable(title, header, rows)]
