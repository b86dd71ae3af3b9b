"""What is left of the signals in sentences: how many floors, and which log would decide."""

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.preparation.acceptance_floors import ERRORS, NOISE, REPEATS, REST, TOLERANCE
from pma_gym.discovery.report.figure_text import figure, listed, signal_name, signal_unit
from pma_gym.discovery.result.noise import Judgement
from pma_gym.discovery.thresholds import COMPLETE, ENOUGH_FOR_FLOOR, LEAST_BLOCKS, MOST_EXPLAINED
from pma_gym.discovery.verdict.adequacy import OPEN

FLOORS = {
    REPEATS: "the scatter between repeats",
    TOLERANCE: "the tolerance",
    NOISE: "the readings' noise",
    REST: "the noise at rest",
    ERRORS: "the standard error",
}
"""Each source of a floor in words."""


def agreement(diagnosis: Diagnosis) -> str:
    """Within what a model agrees with trials: `within 0.2 mm in contraction`; empty for noise."""
    within = [
        f"{figure(each.floor)} {signal_unit(signal)} in {signal_name(signal)}"
        for signal, each in diagnosis.adequacy.items()
        if each.source == TOLERANCE
    ]
    return f" within {listed(within)}" if within else ""


def remainder(diagnosis: Diagnosis) -> str:
    """What is left where a model agrees: the noise of the sensors, or what repeats differ by."""
    sources = [each.source for each in diagnosis.adequacy.values()]
    what = {
        NOISE: "the noise of the sensors",
        REST: "the noise of the sensors",
        REPEATS: "what repeats differ by",
        TOLERANCE: "less than the tolerance",
        ERRORS: "the standard error of the readings",
    }
    said = dict.fromkeys(what[source] for source in sources if source)
    return listed(list(said)) or "the noise of the sensors"


def floors_left(diagnosis: Diagnosis) -> str:
    """How many floors are left of each signal, in one sentence; empty where nothing is known."""
    held = all(each.misfit is not None for each in diagnosis.adequacy.values())
    parts = [
        f"{figure(each.misfit if held else each.fitted, 2)} in {signal_name(signal)} "
        f"({FLOORS[each.source]}, {figure(each.floor)} {signal_unit(signal)})"
        for signal, each in diagnosis.adequacy.items()
        if each.floor is not None and (each.misfit if held else each.fitted) is not None
    ]
    if not parts:
        return ""
    seen = "readings that it was not fitted to" if held else "the readings that it was fitted to"
    return f"Misfit of the proposed model on {seen}, in noise floors: {', '.join(parts)}."


def undecided(diagnosis: Diagnosis) -> str:
    """Why it is undecidable whether structure is missing, and which log would decide."""
    signal, judged = _worst(diagnosis)
    name, unit = signal_name(signal), signal_unit(signal)
    if judged.fault == "no floor":
        return (
            f"{name} has neither a repeat, a rest segment nor a tolerance that its misfit could be "
            f"judged by; log one of the trials twice, or a trial that holds its commands for some "
            f"seconds ({ENOUGH_FOR_FLOOR} readings or more at rest), or state the misfit that is "
            f"good enough in dataset.toml: [tolerance], {signal} = a number in {unit}"
        )
    if judged.fault == "not left out":
        return (
            "there is one short trial, of which no reading can be left out of the fit; log a "
            "second trial with other commands"
        )
    if judged.fault == "alike":
        return (
            f"{name} drifts alike in all trials, and a sensor drifts otherwise in each: "
            "something slow, such as a leak, may be missing; log a trial that holds its commands "
            "for as long, and one of these again after a wait: a leak or creep begins with each "
            "trial, the drift of a sensor does not"
        )
    if judged.fault == "wide":
        return (
            f"a missing law of state or command may still cause up to "
            f"{figure(judged.bound, 2)} noise floors of {name}, and only a bound below "
            f"{MOST_EXPLAINED:g} rules one out; {_longer(judged)}"
        )
    what = (
        f"the misfit of {name} in trials left out of the fit is {figure(judged.misfit, 2)} noise "
        "floors"
        if judged.fault == "not predicted"
        else f"the residual of {name} in trials left out of the fit follows the state "
        f"({figure(judged.explained, 2)} noise floors)"
    )
    return (
        f"{what}, although a fit to all trials leaves {figure(judged.fitted, 2)} (at most "
        f"{COMPLETE:g} may be left): the other trials do not determine the parameters; log more "
        "trials with commands like these"
    )


def _worst(diagnosis: Diagnosis) -> tuple[str, Judgement]:
    """The signal that leaves most open."""
    faulty = [item for item in diagnosis.adequacy.items() if item[1].fault in OPEN]
    return max(faulty, key=lambda item: item[1].misfit or 0.0)


def _longer(judged: Judgement) -> str:
    """How much more to log where a bound is too wide; it shrinks with the root of the time."""
    if judged.bound is None:
        return f"log at least {LEAST_BLOCKS} s in all"
    times = (judged.bound / MOST_EXPLAINED) ** 2
    return f"log {figure(max(times, 2.0), 2)} times as long"
