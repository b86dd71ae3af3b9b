"""The tables of a diagnosis."""

from collections.abc import Mapping

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.adequacy_text import FLOORS
from pma_gym.discovery.report.effect_text import effect_name, effect_names, readable
from pma_gym.discovery.report.figure_text import (
    chance,
    estimate,
    figure,
    gap_closed,
    interval,
    percent,
    signal_name,
    signal_unit,
    undetermined_text,
    unit_cell,
)
from pma_gym.discovery.result.estimates import Moved, NamedEffect
from pma_gym.discovery.result.misfit import Gap, Place
from pma_gym.discovery.result.noise import Floor, Judgement
from pma_gym.discovery.thresholds import COMPLETE, MOST_EXPLAINED
from pma_gym.pages.document import TextTable


def places_table(places: tuple[Place, ...]) -> TextTable:
    """Where they disagree, the largest share first."""
    rows = [
        [signal_name(each.signal), each.region, percent(each.share_of_gap), chance(each.p_value)]
        for each in places
    ]
    header = ["Signal", "Where", "Share of its misfit", "By chance"]
    return TextTable("Where the misfit lies, parameters refitted", header, rows, words=2)


def gap_table(gaps: Mapping[str, Gap]) -> TextTable:
    """Before, after and noise by signal."""
    rows = [
        [
            f"{signal_name(signal)} ({signal_unit(signal)})",
            figure(gap.before),
            figure(gap.parameters),
            figure(gap.after),
            figure(gap.floor),
            percent(gap_closed(gap)) if gap_closed(gap) is not None else "no gap",
            "yes" if gap.held_out else "no",
        ]
        for signal, gap in gaps.items()
    ]
    header = ["Signal", "Model as given", "Parameters refitted", "Model proposed", "Noise"]
    return TextTable("Misfit (rms)", [*header, "Gap closed", "Held out"], rows)


FAULTS = {
    "misfit": "misfit too large",
    "explained": "regression explains too much",
    "not predicted": "misfit too large on readings left out",
    "follows": "regression explains too much of readings left out",
    "alike": "drift alike in all trials",
    "wide": "bound too wide",
    "no floor": "no floor",
    "not left out": "no readings left out",
}
"""What is wrong with a signal, in words."""


def adequacy_table(judgements: Mapping[str, Judgement]) -> TextTable:
    """Misfit of each signal by the proposed model in noise floors, and the verdict on it."""
    rows = []
    for signal, each in judgements.items():
        size = "–" if each.floor is None else f"{figure(each.floor)} {signal_unit(signal)}"
        most = f"{figure(each.explained, 2)} (at most {figure(each.bound, 2)})"
        rows.append(
            [
                signal_name(signal),
                f"{FLOORS.get(each.source, 'none')}, {size}",
                figure(each.fitted, 2),
                figure(each.misfit, 2),
                "–" if each.explained is None else most,
                FAULTS.get(each.fault, each.fault) if each.fault else "noise",
            ]
        )
    header = ["Signal", "Noise floor", "Misfit, fitted readings", "Misfit, readings left out"]
    title = (
        f"Misfit of the proposed model in noise floors: at most {COMPLETE:g}, of which a "
        f"regression on state and command explains less than {MOST_EXPLAINED:g}"
    )
    return TextTable(title, [*header, "Explained by a regression", "Verdict"], rows, words=2)


def effect_table(effect: NamedEffect) -> TextTable:
    """An effect's parameters."""
    rows = [
        [
            f"`{name}`",
            estimate(known.value, known.low, known.high),
            interval(known),
            unit_cell(known.unit),
        ]
        for name, known in effect.parameters.items()
    ]
    rows += [
        [f"`{name}`", "–", undetermined_text(left), unit_cell(left.unit)]
        for name, left in effect.undetermined.items()
    ]
    title = f"Size of the effect: {effect_name(effect.name)}"
    return TextTable(title, ["Parameter", "Value", "95 % interval", "Unit"], rows)


def moved_table(parameters: Mapping[str, Moved], title: str = "Parameters refitted") -> TextTable:
    """The model's own parameters: those that differ first."""
    ordered = sorted(parameters.items(), key=lambda item: not item[1].significant)
    rows = [
        [
            f"`{path}`",
            figure(moved.start, 4),
            estimate(moved.now.value, moved.now.low, moved.now.high),
            interval(moved.now),
            unit_cell(moved.now.unit),
            "yes" if moved.significant else "no",
        ]
        for path, moved in ordered
    ]
    header = ["Parameter", "As given", "Refitted", "95 % interval", "Unit", "Differs"]
    return TextTable(title, header, rows)


def candidates_table(diagnosis: Diagnosis) -> TextTable:
    """The whole catalogue with the evidence for and against each."""
    rows = [
        [
            effect_name(each.name),
            readable(each.why, diagnosis) + ("" if each.fitted else " (screened only)"),
            figure(each.delta_log_likelihood),
            figure(each.held_out_gain) if each.held_out_gain is not None else "–",
            chance(each.p_value),
            figure(each.change, 2),
            percent(each.resolvable) if each.resolvable is not None else "never",
        ]
        for each in diagnosis.candidates
    ]
    header = [
        "Effect",
        "Decision",
        "Gain in log-likelihood",
        "Held out, per reading",
        "By chance",
        "Change / noise",
        "Would show from",
    ]
    return TextTable("The likeliest first", header, rows, words=2)


def floors_table(floors: Mapping[str, Floor]) -> TextTable:
    """The noise of each signal and where it is known from."""
    rows = [
        [
            f"{signal_name(signal)} ({signal_unit(signal)})",
            floor.source,
            figure(floor.value),
            figure(floor.step) if floor.step else "none seen",
            ", ".join(f"{source} {figure(value)}" for source, value in floor.by_source.items()),
        ]
        for signal, floor in floors.items()
    ]
    header = ["Signal", "Known from", "Noise", "Smallest step", "All sources"]
    return TextTable("Noise floors (standard deviation)", header, rows, words=2)


def unknown_table(diagnosis: Diagnosis) -> TextTable:
    """Parameters that the data do not determine."""
    rows = [[f"`{path}`", why] for path, why in diagnosis.not_identifiable.items()]
    title = "Not determined by these data; they keep the values that the model came with"
    return TextTable(title, ["Parameter", "Why"], rows, words=2)


def confusion_table(effects: tuple[NamedEffect, ...]) -> TextTable:
    """Which effects are taken for which."""
    rows = [
        [effect_name(each.name), effect_names(each.confused_with)]
        for each in effects
        if each.confused_with
    ]
    return TextTable("Not identifiable from these data", ["Named", "Also possible"], rows, words=2)
