"""The verdict `unknown` in words: what the best effects leave, and the figure beyond its limit."""

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.approximate_text import MANY, left_text
from pma_gym.discovery.report.effect_text import effect_name, effect_names
from pma_gym.discovery.report.figure_text import figure, percent, signal_name
from pma_gym.discovery.report.size_text import sized_effects
from pma_gym.discovery.verdict.residual_laws import LAWS
from pma_gym.discovery.verdict.unknown import Reason

_WHAT = "what is slow in"


def unknown_sentence(diagnosis: Diagnosis, reason: Reason, trials: str) -> str:
    """That no effect carries what is missing and why; one more sentence for an oscillation.

    Args:
        diagnosis: the diagnosis.
        reason: why its verdict is `unknown`.
        trials: its trials in words, `these 6 trials`.
    """
    residual = f"the residual of {trials}"
    if not diagnosis.candidates:
        return _refitted(diagnosis, reason, trials)
    beyond = {
        "unexplained": _unexplained,
        "misfit": _misfit,
        "explained": _explained,
        "slow": _slow,
        "autocorrelated": _autocorrelated,
        "scatters": _scatters,
        "outdone": _outdone,
        "undetermined": _undetermined,
        "alike": _alike,
    }[reason.why]
    return (
        f"Something is missing in model {diagnosis.given.name} that {_not_carried(diagnosis)}: "
        f"{_best(reason, residual)}, {beyond(reason, residual)}."
    ) + f"{_candidate(diagnosis)}{_tones(diagnosis)}"


def _not_carried(diagnosis: Diagnosis) -> str:
    """What does not carry the residual; one that could not be fitted may."""
    if not diagnosis.unfitted:
        return "no effect of the catalogue carries"
    one = len(diagnosis.unfitted) == 1
    return (
        f"no effect carries that could be fitted; {effect_names(diagnosis.unfitted)}, which may, "
        f"could not, although {'its score promises' if one else 'their scores promise'} more"
    )


def _candidate(diagnosis: Diagnosis) -> str:
    """One more sentence: the best candidates with their sizes, where they carry most."""
    known = diagnosis.approximate
    if known is None:
        return ""
    closed = percent(1.0 - max(known.left, 0.0))
    return (
        f" The best candidate is {sized_effects(known.effects)}: it closes {closed} of the misfit "
        f"beyond noise; {left_text(known)}."
    )


def _best(reason: Reason, residual: str) -> str:
    """The best effects and what they leave."""
    leaves = percent(min(reason.leaves, 1.0))
    if reason.why == "alike":
        verb = "does" if len(reason.effects) == 1 else "do"
        return f"the best, {effect_names(reason.effects)}, {verb} not carry it"
    if reason.effects:
        verb = "leaves" if len(reason.effects) == 1 else "leave"
        share = _past(leaves, percent(reason.limit)) if reason.why == "slow" else leaves
        return f"the best, {effect_names(reason.effects)}, {verb} {share} of {_WHAT} {residual}"
    if not reason.nearest:
        return "there was none to try"
    likeliest = effect_name(reason.nearest)
    return f"none was added (the likeliest, {likeliest}, would leave {leaves} of chi-square)"


def _unexplained(reason: Reason, residual: str) -> str:
    limit = figure(reason.limit)
    return (
        f"and {residual} is autocorrelated in {signal_name(reason.of)} for longer than noise: by "
        f"{_past(figure(reason.figure), limit)} standard errors, where chance stays below {limit}"
    )


def _misfit(reason: Reason, _: str) -> str:
    return f"and the misfit of {signal_name(reason.of)} is {_floors(reason)}"


def _explained(reason: Reason, residual: str) -> str:
    return (
        f"and a flexible regression on state and command explains {_floors(reason)} of {residual} "
        f"in {signal_name(reason.of)}"
    )


def _floors(reason: Reason) -> str:
    """A figure in floors, beside its limit: `26 noise floors (at most 1.5 may be left)`."""
    limit = figure(reason.limit)
    return f"{_past(figure(reason.figure, 2), limit)} noise floors (at most {limit} may be left)"


def _refitted(diagnosis: Diagnosis, reason: Reason, trials: str) -> str:
    """What parameters leave, where effects were not looked for."""
    off = (
        f"the misfit of {signal_name(reason.of)} is {_floors(reason)}"
        if reason.why == "misfit"
        else f"a flexible regression still explains {_floors(reason)} of {signal_name(reason.of)}"
    )
    return (
        f"Refitted to {trials}, model {diagnosis.given.name} misses something: {off}, and "
        "parameters alone do not explain that; pma-gym diagnose looks for what is missing."
    )


def _slow(reason: Reason, residual: str) -> str:
    limit = percent(reason.limit)
    if reason.effects:
        return f"where at most {limit} may be left"
    share = _past(percent(min(reason.figure, 1.0)), limit)
    return f"so {share} of {_WHAT} {residual} is left, where at most {limit} may be"


def _autocorrelated(reason: Reason, residual: str) -> str:
    limit = percent(reason.limit)
    share = _past(percent(min(reason.figure, 1.0)), limit)
    its = "its autocorrelation" if reason.effects else f"the autocorrelation of {residual}"
    return f"but {share} of {its} is left, where at most {limit} may be"


def _scatters(reason: Reason, _: str) -> str:
    by = "from trial to trial" if reason.by == "trial" else f"with the {reason.by}"
    limit = percent(reason.limit)
    share = _past(percent(reason.figure), limit)
    if reason.figure > MANY:
        share = f"more than {MANY:g} times itself"
    return (
        f"but the size of {effect_name(reason.of)} scatters {by} by {share}, where that of the "
        f"right law does by {limit} at most"
    )


def _undetermined(reason: Reason, _: str) -> str:
    return (
        "but beside each other they are not determined: "
        f"{'either' if len(reason.effects) == 2 else 'each'} may be absent"
    )


def _alike(reason: Reason, _: str) -> str:
    return (
        f"since {signal_name(reason.of)} drifts alike in all trials (chance {reason.figure:.0e}), "
        "and a sensor drifts otherwise in each"
    )


def _outdone(reason: Reason, _: str) -> str:
    quantity, variable, _ = (words.partition(" (")[0] for words in LAWS[reason.of])
    law, effects, limit = map(figure, (reason.figure, reason.gain, reason.limit))
    return (
        f"but a {quantity} drawn freely over {variable} explains more: it lowers chi-square by "
        f"{_past(law, limit)}, they by {effects}, and up to {limit} would be no better"
    )


def _past(said: str, limit: str) -> str:
    """A figure in words, which is over its limit even where both round to the same."""
    return f"just over {limit}" if said == limit else said


def _tones(diagnosis: Diagnosis) -> str:
    tones = [
        f"{signal_name(signal)} oscillates at {figure(hertz)} Hz"
        for signal, hertz in diagnosis.tones.items()
    ]
    return f" What is left of {' and that of '.join(tones)}." if tones else ""
