"""What a diagnosis found, in words and figures that people read."""

import inspect
import math
import re
import sys

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial_columns import BY_NAME
from pma_gym.discovery.diagnosis import Diagnosis, Estimate, Gap, Undetermined
from pma_gym.effects import CATALOGUE
from pma_gym.units import with_unit

VERDICTS = {
    "effect": "An effect is missing",
    "parameters": "Parameters were off",
    "agrees": "Model and data agree",
    "unknown": "Something unknown is missing",
    "undecidable": "Undecidable from these data",
}
"""Each verdict in a few words."""

_NAMES = {"lvdt": "LVDT", "coulomb": "Coulomb"}
_WHOLE = {"load_dependent_damping": "load-dependent damping"}
_PEOPLE = ("sarosi", "schulte", "schulz", "chou", "hannaford", "caldwell", "tondu", "lopez")


def effect_name(name: str) -> str:
    """An effect's name as people write it.

    >>> effect_name("coulomb_friction"), effect_name("lvdt_error")
    ('Coulomb friction', 'LVDT error')
    """
    if name in _WHOLE:
        return _WHOLE[name]
    words = [
        _NAMES.get(word, word.capitalize() if word in _PEOPLE else word) for word in name.split("_")
    ]
    return " ".join(words)


def readable(text: str, diagnosis: Diagnosis) -> str:
    """A text with the names of effects as people write them; parameters keep theirs."""
    named = {*CATALOGUE, *(each.name for each in diagnosis.candidates)}
    alternatives = "|".join(sorted((name for name in named if "_" in name), key=len, reverse=True))
    return re.sub(rf"(?<![\w.`])({alternatives})(?![\w.`])", lambda hit: effect_name(hit[1]), text)


def effect_names(names: tuple[str, ...] | list[str], joint: str = "and") -> str:
    """Several effects: `creep, hysteresis and filling`."""
    return listed([effect_name(name) for name in names], joint)


def listed(words: list[str], joint: str = "and") -> str:
    """Words in a row: `a, b and c`.

    >>> listed(["a", "b", "c"]), listed(["a"]), listed([])
    ('a, b and c', 'a', '')
    """
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {joint} {words[-1]}"


def effect_summary(name: str) -> str:
    """What the effect is: the first line of its file, or of its law."""
    effect = CATALOGUE.get(name)
    if effect is None or effect.law is None:
        return ""
    own = sys.modules[effect.law.__module__].__doc__ or effect.law.__doc__ or ""
    return own.strip().splitlines()[0] if own.strip() else ""


def effect_equation(name: str) -> str:
    """The indented lines of the law's docstring, as they stand there; empty if it has none."""
    effect = CATALOGUE.get(name)
    text = (effect.law.__doc__ or "") if effect and effect.law else ""
    match = re.search(r"\n\n((?: {8}\S[^\n]*\n)+)", text)
    return "\n".join(line.strip() for line in match[1].splitlines()) if match else ""


def effect_symbols(name: str) -> str:
    """What stands in the law's equation: the arguments of its docstring, a line each."""
    effect = CATALOGUE.get(name)
    text = (inspect.getdoc(effect.law) or "") if effect and effect.law else ""
    match = re.search(r"\nArgs:\n(.*?)(?=\n\S|\Z)", text, re.DOTALL)
    if not match:
        return ""
    joined = re.sub(r"\n {5,}", " ", match[1])
    return "\n".join(line.strip() for line in joined.splitlines() if line.strip())


def signal_name(signal: str) -> str:
    """`contraction_mm` as `contraction`."""
    known = SIGNALS.get(BY_NAME[signal].quantity) if signal in BY_NAME else None
    return signal if known is None else known.called or known.name


def signal_unit(signal: str) -> str:
    """`contraction_mm` is in mm."""
    return BY_NAME[signal].unit


def unit_cell(unit: str) -> str:
    """A unit in a column of units, which a pure number leaves blank.

    >>> unit_cell("N/mm"), unit_cell("1")
    ('N/mm', '')
    """
    return "" if unit == "1" else unit


def figure(value: float | None, digits: int = 3) -> str:
    """A number with three significant digits, without an exponent where people write none.

    >>> figure(0.8391), figure(1234.5), figure(4.5e-5), figure(None), figure(12.0)
    ('0.839', '1230', '4.5e-05', '–', '12')
    """
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < 1e6 else text


def estimate(value: float, low: float | None, high: float | None) -> str:
    """A value with as many decimals as its interval deserves.

    >>> estimate(14.2371, 13.12, 15.38), estimate(0.021, 0.0187, 0.0233), estimate(14.2371, None, 3)
    ('14.2', '0.0210', '14.2')
    """
    if low is None or high is None or not 0.0 < high - low < math.inf:
        return figure(value)
    decimals = 1 - math.floor(math.log10(0.5 * (high - low)))
    return f"{value:.{max(decimals, 0)}f}" if decimals <= 8 else figure(value)


def interval(known: Estimate) -> str:
    """The 95 % interval of an estimate: `13.1 to 15.4`."""
    low, high = known.low, known.high
    if low is None and high is None:
        return "not bounded by these data"
    if low is None or high is None:
        return f"above {figure(low)}" if high is None else f"below {figure(high)}"
    return f"{estimate(low, low, high)} to {estimate(high, low, high)}"


def estimate_text(known: Estimate) -> str:
    """`14.2 N (95 %: 13.1 to 15.4)`."""
    value = with_unit(estimate(known.value, known.low, known.high), known.unit)
    return f"{value}{at_its_limit(known)} (95 %: {interval(known)})"


def undetermined_text(known: Undetermined) -> str:
    """`not determined, above 20 mm/s`."""
    if known.above is None and known.below is None:
        return "not determined"
    side = "below" if known.above is None else "above"
    bound = known.below if known.above is None else known.above
    return f"not determined, {side} {with_unit(figure(bound, 2), known.unit)}"


def at_its_limit(known: Estimate) -> str:
    """That a value is at an end of what the fit allows; empty where it is not."""
    return f" (at its {known.limit} limit)" if known.limit else ""


def chance(p_value: float) -> str:
    """A p-value: `p < 0.001`."""
    return "p < 0.001" if p_value < 0.001 else f"p = {p_value:.2g}"


def percent(share: float | None) -> str:
    """A share: `71 %`.

    >>> percent(0.714), percent(0.9991), percent(0.001), percent(None)
    ('71 %', '99.9 %', '< 1 %', '–')
    """
    if share is None:
        return "–"
    if 0.0 < share < 0.005:
        return "< 1 %"
    return f"{100 * share:.1f} %" if 0.99 < share < 1.0 else f"{100 * share:.0f} %"


_WORTH_CLOSING = 1.1
"""Misfit over noise from which there is a gap to speak of."""


def gap_closed(gap: Gap) -> float | None:
    """The share of a gap that was closed; None where noise hides what there was to close."""
    return gap.closed if gap.before > _WORTH_CLOSING * gap.floor else None


def odds(ratio: float) -> str:
    """Expected odds, which only their size says anything about."""
    return "over 1000 to 1" if ratio > 1000 else f"about {ratio:.2g} to 1"


def duration(minutes: float) -> str:
    """How long an experiment takes.

    >>> duration(0.17), duration(2.5)
    ('10 s', '2.5 min')
    """
    return f"{60 * minutes:.0f} s" if minutes < 2.0 else f"{minutes:.2g} min"


def capitalised(text: str) -> str:
    """With a large first letter; the others as they are."""
    return text[:1].upper() + text[1:]


def what_to_do(diagnosis: Diagnosis) -> list[str]:
    """The next things to do, the first first."""
    steps = {
        "effect": _use_effect,
        "parameters": _use_parameters,
        "agrees": _use_as_is,
        "unknown": _describe,
        "undecidable": _measure,
    }[diagnosis.verdict](diagnosis)
    if diagnosis.next_experiment and diagnosis.verdict != "undecidable":
        steps.append(_run_next(diagnosis))
    return steps


def _use_effect(diagnosis: Diagnosis) -> list[str]:
    steps = ["Use the amended model, `model.toml` beside this page"]
    # The environments' tasks are a muscle's.
    steps[0] += (
        ': `gym.make("pma_gym/IsokineticDisplacement-v0", model="model.toml")`.'
        if diagnosis.model.rig.balances_loads
        else ': `Plant(load_model("model.toml")).simulate(trial)`.'
    )
    for effect in diagnosis.effects:
        if effect.confused_with:
            rivals = effect_names(effect.confused_with, "or")
            steps.append(
                f"Do not yet rely on its name: {rivals} would explain these data as well. The "
                "amended model predicts trials like these either way."
            )
    return steps


def _use_parameters(diagnosis: Diagnosis) -> list[str]:
    moved = [path for path, each in diagnosis.parameters.items() if each.significant]
    named = listed([f"`{path}`" for path in moved[:3]])
    steps = ["Use the refitted model, `model.toml` beside this page; no new effect is needed."]
    if moved:
        steps.append(f"Check on the rig why {named} differ{'s' if len(moved) == 1 else ''}.")
    return steps


def _use_as_is(diagnosis: Diagnosis) -> list[str]:
    steps = [f"Keep the model {diagnosis.given.name}: nothing in these trials speaks against it."]
    if diagnosis.not_detectable:
        steps.append(
            "These trials cannot show "
            f"{effect_names(diagnosis.not_detectable, 'or')}; if one of them matters to you, "
            "measure what excites it."
        )
    return steps


def _describe(diagnosis: Diagnosis) -> list[str]:
    steps = ["Look at the law below: any explanation must have its shape."] * bool(diagnosis.law)
    steps += [
        f"Look for what oscillates at {figure(hertz)} Hz and reaches the {signal_name(signal)}: a "
        "loose frame, a hose, a supply, the mains beyond half the sampling rate."
        for signal, hertz in diagnosis.tones.items()
    ]
    return [
        *steps,
        "Write it as a user effect, one Python file, and diagnose again with `--effect FILE.py`.",
    ]


def _measure(diagnosis: Diagnosis) -> list[str]:
    if diagnosis.next_experiment is None:
        rig = diagnosis.given.rig
        more = "loads and pressures" if rig.has_muscle else "positions and forces"
        return [f"Measure trials that move the {rig.name} further: more speeds, {more}."]
    return [
        _run_next(diagnosis),
        "Keep the given model until then: `model.toml` only has refitted parameters.",
    ]


def _run_next(diagnosis: Diagnosis) -> str:
    following = diagnosis.next_experiment
    assert following is not None
    excitation = following.excitation[:1].lower() + following.excitation[1:]
    run = (
        f"`next.csv` on the rig ({excitation}; {duration(following.minutes)}), save its log into "
        "the data set under a new name, and diagnose again."
    )
    if diagnosis.verdict in ("parameters", "agrees"):
        shown = effect_names(following.separates, "or")
        return f"These trials cannot show {shown}. To rule that out, run {run}"
    return f"Run {run}"
