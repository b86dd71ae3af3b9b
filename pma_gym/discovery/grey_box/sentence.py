"""The verdict of a free rig as a person would say it."""

from pma_gym.discovery.grey_box.conclusions import Conclusions
from pma_gym.discovery.grey_box.hypothesis import Hypothesis
from pma_gym.discovery.grey_box.latent_law import FORCES, largest_share
from pma_gym.discovery.grey_box.prepared_trials import CLOCK
from pma_gym.discovery.grey_box.sizes import estimate
from pma_gym.discovery.grey_box.slots import path_of, quantity_of
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
from pma_gym.discovery.result.estimates import Estimate
from pma_gym.discovery.thresholds import CONFIDENCE
from pma_gym.estimation.innovations import TREND, TRIAL
from pma_gym.estimation.likelihood_fit import value_of
from pma_gym.units import SI_FACTORS

WHAT_TO_CHECK = (
    "A friction before it slips (presliding), a sharper law or the commands between rows may "
    "differ; log at rest, repeat a trial, check the clock."
)
"""What to look at where something small is left."""


def sentence(conclusions: Conclusions) -> str:
    """The verdict in a sentence or two, and what is wrong with the logging."""
    return " ".join([_verdict(conclusions), *_logging(conclusions)])


def _logging(conclusions: Conclusions) -> list[str]:
    """What is wrong with sensors and the clock."""
    made, trials, said = conclusions.proposal.last.fit, conclusions.selection.trials, []
    for hum in trials.hums:
        signal = trials.model.rig.signals[hum.channel]
        size = f"{figure(hum.amplitude / SI_FACTORS[signal.unit])} {signal.unit}"
        said.append(f"The sensor of {signal.name} hums at {figure(hum.hertz)} Hz with {size}.")
    if made.point.colour:
        signal = trials.model.rig.signals[trials.channels[0]]
        size = f"{figure(made.point.colour / SI_FACTORS[signal.unit])} {signal.unit}"
        lasts = figure(made.point.colour_memory, 2)
        said.append(
            f"The sensor of {signal.name} has coloured noise of {size} with a correlation time of "
            f"{lasts} s."
        )
    if CLOCK.name not in made.deviations:
        return said
    value, error = 100.0 * made.point.clock, 100.0 * CONFIDENCE * made.deviations[CLOCK.name]
    size, way = abs(value), "fast" if value > 0.0 else "slow"
    off = estimate_text(Estimate(size, size - error, size + error, "%"))
    return [*said, f"The clock of the readings runs {off} {way} beside that of the commands."]


def _verdict(conclusions: Conclusions) -> str:
    """What is missing or off, and what predictions miss by."""
    own, left = listed(by_trial(conclusions)), _left(conclusions, conclusions.proposal.last)
    if conclusions.verdict == "effect":
        rest = f"; {own}" if own else ""
        is_rough = conclusions.proposal.share(conclusions.proposal.last) > MATERIAL
        approximate = f"; the law is approximate: {left}, is left" if is_rough else ""
        named = sized_effects(conclusions.effects)
        return f"{named} missing{rest}: {_misses(conclusions)}{approximate}."
    if conclusions.verdict == "unknown":
        words = f" It {conclusions.law.words}." if conclusions.law else ""
        if conclusions.proposal.last.free_law:
            words += f" With that law {_misses(conclusions)}."
            left = _left(conclusions, conclusions.predictions.path[0])
        if conclusions.line:
            hertz, of = conclusions.line
            words += f" It oscillates at {figure(hertz)} Hz: {percent(of)} of its variance."
        names = effect_names([each.name for each in conclusions.effects])
        best = f" Best candidate: {names}, which leaves {percent(conclusions.proposal.left)} of it."
        number, share = largest_share(conclusions.smooth)
        words += f" {percent(share)} of it acts in {conclusions.named[number].name}."
        rig, best = conclusions.selection.trials.model.plant, best if conclusions.effects else ""
        return (
            f"Something that no effect of the catalogue carries acts on the {rig}: {left}."
            f"{words}{best}"
        )
    if conclusions.verdict == "undecidable" and conclusions.proposal.far:
        return _far(conclusions)
    if conclusions.verdict == "undecidable":
        return f"Too little is left to name: {left}, but {_misses(conclusions)}. {WHAT_TO_CHECK}"
    if own:
        return f"Trials differ: {own}; {_misses(conclusions)}."
    if conclusions.verdict == "parameters":
        moved = [
            f"{path} {estimate_text(each.now)} instead of {figure(each.start)}"
            for path, each in conclusions.parameters.items()
            if each.significant
        ]
        said = f"parameters are off: {listed(moved[:4])}"
        return f"No effect is missing; {said}; {_misses(conclusions)}; {left}, is left."
    trials = "these trials" if len(conclusions.named) > 1 else "this trial"
    return f"The model agrees with {trials}: {_misses(conclusions)}; {left}, is left."


def _far(conclusions: Conclusions) -> str:
    """What the fit does to a parameter that the model should have nearly right."""
    moved = []
    for name in conclusions.proposal.far:
        now = conclusions.parameters[path_of(name)]
        moved.append(f"{path_of(name)} {estimate_text(now.now)} instead of {figure(now.start)}")
    names = effect_names([each.name for each in conclusions.effects])
    beside = f", beside {names}" if names else ""
    return (
        f"These trials do not decide: they are best explained by {listed(moved)}{beside}, too far "
        "from the model to believe. If that value is a guess, write the fitted one into the model "
        "and diagnose again; else check the units and the sign of the command, and log a trial "
        "with faster reversals."
    )


def _misses(conclusions: Conclusions) -> str:
    """What predictions miss by."""
    (signal, gap), *_ = conclusions.gap.items()
    parts = "trials" if len(conclusions.named) > 1 else "stretches"
    seen = f" of {parts} that it was not fitted to" if gap.held_out else ""
    ahead = f"{figure(conclusions.predictions.horizon, 2)} s ahead{seen}"
    return (
        f"predictions of {signal_name(signal)} {ahead} miss by "
        f"{figure(gap.after)} {signal_unit(signal)} instead of {figure(gap.before)} (parameters "
        f"refitted {figure(gap.parameters)}, noise {figure(gap.floor)})"
    )


def _left(conclusions: Conclusions, each: Hypothesis) -> str:
    """The latent force that is left beside a hypothesis."""
    what, unit = FORCES[conclusions.selection.trials.model.plant]
    share = conclusions.proposal.share(each)
    size = figure(share * conclusions.selection.trials.force)
    return f"a latent {what.split()[0]} of {size} {unit}, {percent(share)} of the drive's"


def by_trial(conclusions: Conclusions) -> list[str]:
    """Parameters that differ by trial, a clause each."""
    said = []
    rig = [move for move in conclusions.proposal.last.moves if not move.is_nuisance]
    for name in (name for move in rig for name in move.slots):
        base = name.partition(TREND)[0].partition(TRIAL)[0]
        now, path = estimate(conclusions.proposal.last.fit, name), path_of(base)
        usual = quantity_of(base).from_si(value_of(conclusions.proposal.last.fit.point, base))
        if TREND in name:
            way = "falls" if now.value * usual < 0.0 else "rises"
            share = percent(abs(now.value / usual)) if usual else figure(abs(now.value))
            said.append(f"{path} {way} by {share} from trial to trial ({estimate_text(now)})")
        else:
            trial = conclusions.named[int(name.partition(TRIAL)[2])].name
            size = f"{estimate_text(now)} instead of {figure(usual)}"
            said.append(f"{trial} alone needs {path} {size}")
    return said
