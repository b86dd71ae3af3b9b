"""The verdict of a free rig as a person would say it."""

from pma_gym.discovery.grey_box.found import Found, path_of, quantity_of
from pma_gym.discovery.grey_box.thresholds import MATERIAL
from pma_gym.discovery.report.effect_text import effect_names
from pma_gym.discovery.report.figure_text import (
    estimate_text,
    figure,
    listed,
    percent,
    signal_name,
    signal_unit,
)
from pma_gym.discovery.report.size_text import sized_effects
from pma_gym.estimation.innovations import TREND, TRIAL
from pma_gym.estimation.likelihood_fit import value_of

WHAT_TO_CHECK = (
    "A friction before it slips (presliding), a sharper law or the commands between rows may "
    "differ; log at rest, repeat a trial, check the clock."
)
"""What to look at where something small is left."""


def sentence(found: Found) -> str:
    """The verdict in a sentence or two."""
    own, left = listed(by_trial(found)), _left(found)
    if found.verdict == "effect":
        rest = f"; {own}" if own else ""
        is_rough = found.share(found.last) > MATERIAL
        approximate = f"; the law is approximate: {left}, is left" if is_rough else ""
        return f"{sized_effects(found.effects)} missing{rest}: {_misses(found)}{approximate}."
    if found.verdict == "unknown":
        words = f" It {found.law.words}." if found.law else ""
        names = effect_names([each.name for each in found.effects])
        best = f" Best candidate: {names}, which leaves {percent(found.left)} of it."
        return (
            "Something that no effect of the catalogue carries acts on the "
            f"{found.search.model.plant}: {left}.{words}{best if found.effects else ''}"
        )
    if found.verdict == "undecidable":
        return f"Too little is left to name: {left}, but {_misses(found)}. {WHAT_TO_CHECK}"
    if own:
        return f"Trials differ: {own}; {_misses(found)}."
    if found.verdict == "parameters":
        moved = [
            f"{path} {estimate_text(each.now)} instead of {figure(each.start)}"
            for path, each in found.parameters.items()
            if each.significant
        ]
        said = f"parameters are off: {listed(moved[:4])}"
        return f"No effect is missing; {said}; {_misses(found)}; {left}, is left."
    trials = "these trials" if len(found.named) > 1 else "this trial"
    return f"The model agrees with {trials}: {_misses(found)}; {left}, is left."


def _misses(found: Found) -> str:
    """What predictions miss by."""
    (signal, gap), *_ = found.gap.items()
    seen = " of trials that it was not fitted to" if gap.held_out else ""
    return (
        f"predictions of {signal_name(signal)} {figure(found.horizon, 2)} s ahead{seen} miss by "
        f"{figure(gap.after)} {signal_unit(signal)} instead of {figure(gap.before)} (parameters "
        f"refitted {figure(gap.parameters)}, noise {figure(gap.floor)})"
    )


def _left(found: Found) -> str:
    """The latent force that is left."""
    what, unit = ("torque", "N m") if found.search.model.plant == "joint" else ("force", "N")
    share = found.share(found.last)
    size = figure(share * found.search.force)
    return f"a latent {what} of {size} {unit}, {percent(share)} of the drive's"


def by_trial(found: Found) -> list[str]:
    """Parameters that differ by trial, a clause each."""
    said = []
    for name in (name for move in found.last.moves for name in move.slots):
        base = name.partition(TREND)[0].partition(TRIAL)[0]
        now, path = found.estimate(name), path_of(base)
        usual = quantity_of(base).from_si(value_of(found.last.fit.point, base))
        if TREND in name:
            way = "falls" if now.value * usual < 0.0 else "rises"
            share = percent(abs(now.value / usual)) if usual else figure(abs(now.value))
            said.append(f"{path} {way} by {share} from trial to trial ({estimate_text(now)})")
        else:
            trial = found.named[int(name.partition(TRIAL)[2])].name
            size = f"{estimate_text(now)} instead of {figure(usual)}"
            said.append(f"{trial} alone needs {path} {size}")
    return said
