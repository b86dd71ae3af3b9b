"""Selection: which suspects are added to the model, one after the other.

The gate is the look (`screening`): chance may explain as much, over the whole catalogue, in one of
two hundred data sets. It opens too where the residual itself is no noise: where it remembers itself
(`excess`), or bursts (`bursts`) and an effect explains the bursts. What passes is fitted together
with the model's parameters; the likeliest is taken; then the same again beside it. Each effect is
then left out once: one that is not missed goes. Noise is learnt anew only when all effects are
found: before, an autoregression would take the next effect for noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.bursts import NO_BURSTS, Bursts, bursts
from pma_gym.discovery.errors import covariance
from pma_gym.discovery.excess import memory
from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.journal import Journal
from pma_gym.discovery.noise import Whitening, autoregression, step_between
from pma_gym.discovery.parameters import values
from pma_gym.discovery.screening import Baseline, Look, beginnings, closer, look
from pma_gym.discovery.suspects import Suspect
from pma_gym.plant.model import Model
from pma_gym.plant.plant import OUTPUTS

Array = NDArray[np.float64]

ALARM = 0.005
"""Family-wise rate of false alarms that the gate lets through."""

LEAST_CHANGE = 0.15
"""Least rms of what an effect changes beyond parameters, over the noise of the signal where that is
most: what is smaller is not worth a name, and no model's arithmetic is that exact."""

COARSE_CHANGE = 0.5
"""The same beside a sensor whose readings keep to coarse steps: what is lost between them is no
noise, and follows the motion."""

SECOND_SHARE, SURE_SHARE = 0.12, 0.02
"""Least share of the first effect's gain that another must bring: what a law of the catalogue
misses of its real likeness is of that order; and the same where the residual is surely no noise."""

BEGINNINGS = 3
"""How often the selection begins anew from a better refitted model."""

MOST_EFFECTS = 3
"""Most effects that are added."""

TRIED, NEAR = 8, 0.05
"""How many suspects are fitted at most, and the share of the best look's gain that one needs."""

BEGUN, ALL_BEGUN = 2, 8
"""How many fits of a suspect are begun, and how many where no suspect's came near the trials."""

CARRIED = 0.5
"""Share of the bursts in a residual that a fit must explain, where they alone opened the gate:
noise that is larger in places bursts too, and no effect explains half of that."""

COST = 3.0
"""Log-likelihood that a parameter costs: half the logarithm of some 400 effective readings."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Stage:
    """One round of the selection.

    Attributes:
        bench: with the noise of this round.
        before: the model that suspects were tried beside.
        baseline: the same, ready to be looked beside.
        looks: at every suspect.
        fits: of those that were fitted, by name, each together with what was there before.
        gate: the looks that passed.
        missing: whether the residual says of itself that something is missing.
        burst: pieces of it that opened the gate by themselves.
    """

    bench: Bench
    before: Fitted
    baseline: Baseline
    looks: tuple[Look, ...]
    fits: dict[str, Fitted]
    gate: tuple[Look, ...]
    missing: bool
    burst: Bursts = NO_BURSTS


@dataclass(frozen=True)
class Selection:
    """What was selected.

    Attributes:
        stages: the rounds.
        chosen: the suspects in the model, in the order in which they came.
        fit: the model with them.
        bench: with the noise that it leaves.
        refitted: the model with its own parameters refitted alone; better than what the selection
            began with, where it had been caught.
    """

    stages: tuple[Stage, ...]
    chosen: tuple[Suspect, ...]
    fit: Fitted
    bench: Bench
    refitted: Fitted


def select(
    bench: Bench,
    refitted: Fitted,
    suspects: Sequence[Suspect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Selection:
    """Select suspects.

    Args:
        bench: the trials.
        refitted: the model with its own parameters refitted.
        suspects: the whole catalogue.
        seed: of simulated residuals.
        journal: keeps fits.
        progress: called with a step's name, what is done and the total.
    """
    chosen: tuple[Suspect, ...] = ()
    stages: list[Stage] = []
    begun: list[str] = []
    best = refitted
    while len(chosen) < MOST_EFFECTS:
        rest = [suspect for suspect in suspects if suspect not in chosen]
        stage = _stage(bench, best, chosen, rest, seed, journal, progress)
        stages.append(stage)
        added = _likeliest(stage, stages[0])
        if added is None:
            break
        chosen = (*chosen, next(s for s in suspects if s.name == added))
        best = _better(bench, stage.fits[added], chosen, journal)
        chosen, best = _without_idle(bench, best, chosen, refitted, journal)
        if not chosen and best.chi_square < refitted.chi_square and len(begun) < BEGINNINGS:
            # The refitted model had been caught in a hollow that any effect led out of.
            refitted, stages = best, []
            begun.append(added)
        elif len(chosen) < len(stages):
            # One is not missed beside the other, and that is the end of it.
            break
    bench = replace(bench, noise=relearnt(bench, best, chosen))
    fit = _refit(bench, best, chosen, journal)
    fit = replace(fit, covariance=covariance(bench, fit, chosen))
    return Selection(tuple(stages), chosen, fit, bench, refitted)


def relearnt(bench: Bench, fit: Fitted, chosen: Sequence[Suspect]) -> tuple[Whitening, ...]:
    """Whitening of what a fit leaves, never of less than is seen at rest."""
    evidence = bench.evidence(fit.model, chosen)
    left = residuals(evidence, fit)
    found = []
    for channel, before in enumerate(bench.noise):
        parts = [part[channel] for part in left]
        known = [part for part in parts if np.isfinite(part).any()]
        found.append(autoregression(known, before.level) if known else before)
    return tuple(found)


def residuals(evidence, fit: Fitted) -> list[Array]:  # noqa: ANN001
    """Simulated less measured (SI), shape (4, rows) for each trial, free zeros taken out."""
    readings = evidence.readings(fit.values)
    assert readings is not None
    return left_over(evidence, readings)


def left_over(evidence, readings: Sequence[Array]) -> list[Array]:  # noqa: ANN001
    """Simulated less measured (SI), shape (4, rows) for each trial, free zeros taken out."""
    found = []
    for logged, held in zip(evidence.logged, readings, strict=True):
        left = held - logged.measured
        for channel, name in enumerate(OUTPUTS):
            if not logged.measures[channel]:
                left[channel] = np.nan
                continue
            left[channel, logged.missing[channel]] = np.nan
            if name in ("contraction", "rotation"):
                left[channel] -= np.nanmean(left[channel])
        found.append(left)
    return found


def _stage(
    bench: Bench,
    before: Fitted,
    chosen: tuple[Suspect, ...],
    rest: Sequence[Suspect],
    seed: int,
    journal: Journal,
    progress: Progress,
) -> Stage:
    step = f"looking for effect {len(chosen) + 1}"
    progress(step, 0, len(rest))
    baseline = Baseline.at(bench.evidence(before.model, chosen), before.values, before.steps)
    plain = _plain(bench, before)
    looks = look(
        baseline,
        rest,
        seed + len(chosen),
        lambda suspect: bench.probed(plain, suspect),
        lambda done: progress(step, done, len(rest)),
    )
    looks.sort(key=lambda each: -each.gain)
    # Where the residual itself rules chance out, a look need not.
    missing = remembers(bench, before, chosen)
    gate = tuple(each for each in looks if passes(bench, each, missing and not chosen))
    burst = NO_BURSTS if gate or chosen else burst_of(bench, before)
    least, plainly = 0.0, looks
    if burst.excess:
        rows = sum(len(trial.time) for trial in bench.trials)
        # As large as a change must be (`LEAST_CHANGE`), were it all in one signal.
        least = max(CARRIED * burst.excess, LEAST_CHANGE**2 * rows)
        looks = _closer(bench, baseline, plain, looks, burst.chance, least)
        gate = tuple(each for each in looks if each.starts)
    fits: dict[str, Fitted] = {}
    if gate:
        worth = [each for each in looks if each.gain > NEAR * looks[0].gain and each.starts]
        for number, each in enumerate(worth[:TRIED]):
            progress(f"fitting effect {len(chosen) + 1}", number, len(worth[:TRIED]))
            found = _fit(bench, baseline, before, chosen, each, journal)
            if found is not None:
                fits[each.suspect.name] = found
        fits |= _uncaught(bench, baseline, before, chosen, worth, fits, journal)
    if burst.excess and all(before.chi_square - fit.chi_square < least for fit in fits.values()):
        gate, fits, looks, burst = (), {}, plainly, NO_BURSTS
    return Stage(bench, before, baseline, tuple(looks), fits, gate, missing, burst)


def _closer(
    bench: Bench,
    baseline: Baseline,
    plain: Model,
    looks: Sequence[Look],
    chance: float,
    least: float,
) -> list[Look]:
    """Closer looks, the best first; of one that explains bursts, chance is that of the bursts.

    Args:
        bench: the trials.
        baseline: the refitted model.
        plain: the same, as suspects are put into it.
        looks: the looks so far.
        chance: that noise bursts so.
        least: chi-square that explains bursts.
    """
    found = [closer(baseline, bench.probed(plain, each.suspect), each) for each in looks]
    found = [
        replace(each, p_value=min(each.p_value, chance)) if each.gain >= least else each
        for each in found
    ]
    return sorted(found, key=lambda each: -each.gain)


def passes(bench: Bench, each: Look, missing: bool = False) -> bool:
    """Whether chance, or arithmetic, would not show as much; chance may be ruled out already."""
    least = COARSE_CHANGE if bench.coarse else LEAST_CHANGE
    return (missing or each.p_value <= ALARM) and each.change >= least


def remembers(bench: Bench, fit: Fitted, chosen: Sequence[Suspect] = ()) -> bool:
    """Whether what a fit leaves remembers itself and is surely no noise, whatever is hidden.

    Not beside a coarse sensor, whose rounding follows the motion; nor of a slide, whose starts are
    taken from readings, so that what is left remembers their noise.
    """
    if not _tells(bench):
        return False
    left = residuals(bench.evidence(fit.model, chosen), fit)
    rate = float(np.median([1.0 / np.median(np.diff(trial.time)) for trial in bench.trials]))
    return any(memory([part[c] for part in left], rate).sure for c in range(len(OUTPUTS)))


def burst_of(bench: Bench, fit: Fitted) -> Bursts:
    """The bursts in what a fit leaves of all signals; none where `remembers` cannot say either."""
    if not _tells(bench):
        return NO_BURSTS
    evidence = bench.evidence(fit.model)
    left, logged = residuals(evidence, fit), evidence.logged
    edges = [evidence.edges(each) for each in logged]
    found = [
        bursts([part[c] for part in left], edges, bench.noise[c].level, step_between(logged, c))
        for c in range(len(OUTPUTS))
    ]
    chance = min(1.0, len(found) * min(each.chance for each in found))
    return Bursts(chance, sum(each.excess for each in found))


def _tells(bench: Bench) -> bool:
    """Whether a residual tells of itself what is noise."""
    return not bench.coarse and bench.given.plant != "slide"


def cost(fit: Fitted) -> float:
    """Twice the negative log-likelihood, with what parameters cost."""
    return fit.chi_square + 2.0 * COST * len(fit.paths)


def _likeliest(stage: Stage, first: Stage) -> str | None:
    """The suspect to add, or None."""
    if not stage.gate or not stage.fits:
        return None
    passed = {each.suspect.name for each in stage.gate}
    most = stage.gate[0].gain
    # What did not pass may still explain more than what did: a look is linear, a fit is not.
    worth = {
        name: fit
        for name, fit in stage.fits.items()
        if name in passed or stage.before.chi_square - fit.chi_square > most
    }
    if not worth:
        return None
    name = min(worth, key=lambda each: cost(worth[each]))
    gain = stage.before.chi_square - stage.fits[name].chi_square
    if gain < 30.0:
        return None
    if stage is not first:
        least = min(first.fits.values(), key=cost)
        share = SURE_SHARE if stage.missing else SECOND_SHARE
        if gain < share * (first.before.chi_square - least.chi_square):
            return None
    return name


def _plain(bench: Bench, before: Fitted) -> Model:
    """The given model with the parameters of a fit, without the effects that were added."""
    own = {path: float(before.values[before.paths.index(path)]) for path in bench.own.free}
    return bench.given.replace(own)


def _fit(
    bench: Bench,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[Suspect, ...],
    each: Look,
    journal: Journal,
    caught: bool = False,
) -> Fitted | None:
    """The best of fits from the probes that explain most; of more where others were caught."""
    key = f"{bench.noise} {before.names} {each.suspect.name} {each.starts}{' caught' * caught}"
    kept = journal.found(key)
    extra = (*chosen, each.suspect)
    if kept is not None:
        return restored(kept, bench, before, extra)
    best: Fitted | None = None
    evidence = bench.probed(_plain(bench, before), each.suspect)
    for begun in beginnings(baseline, evidence, each)[: ALL_BEGUN if caught else BEGUN]:
        found = bench.fit(before.model, extra, {each.suspect.name: begun})
        if found is not None and caught:
            found = bench.led_out(found, extra)
        if found is not None and (best is None or found.chi_square < best.chi_square):
            best = found
        if best is not None and before.chi_square - best.chi_square >= each.gain and not caught:
            # As much as the look promised: no other beginning is needed.
            break
    if best is None or best.chi_square > before.chi_square:
        # Caught in a hollow: where the effect is absent it explains more.
        return None
    journal.keep(key, kept_form(best))
    return best


def _uncaught(
    bench: Bench,
    baseline: Baseline,
    before: Fitted,
    chosen: tuple[Suspect, ...],
    looks: Sequence[Look],
    fits: dict[str, Fitted],
    journal: Journal,
) -> dict[str, Fitted]:
    """Better fits, the likeliest first, until one comes near the trials; none where one has."""
    known = {each.suspect.name: each for each in looks}
    better: dict[str, Fitted] = {}
    if not all(map(bench.far, fits.values())):
        return better
    for name in sorted(fits, key=lambda each: cost(fits[each])):
        found = _fit(bench, baseline, before, chosen, known[name], journal, caught=True)
        if found is not None and found.chi_square < fits[name].chi_square:
            better[name] = found
        if name in better and not bench.far(better[name]):
            break
    return better


def _better(bench: Bench, fit: Fitted, chosen: tuple[Suspect, ...], journal: Journal) -> Fitted:
    """A fit, or a better one from a careful search: what it misses would look like an effect."""
    key = f"better {bench.noise} {fit.names} {fit.values.tolist()}"
    kept = journal.found(key)
    if kept is not None:
        return restored(kept, bench, fit, chosen)
    given = dict(zip(bench.own.free, values(bench.given, bench.own.free).tolist(), strict=True))
    found = bench.careful_fit(fit.model.replace(given), chosen)
    best = fit if found is None or found.chi_square >= fit.chi_square else found
    best = bench.led_out(best, chosen)
    journal.keep(key, kept_form(best))
    return best


def _refit(bench: Bench, fit: Fitted, chosen: tuple[Suspect, ...], journal: Journal) -> Fitted:
    key = f"again {bench.noise} {fit.names} {fit.values.tolist()}"
    kept = journal.found(key)
    if kept is not None:
        return restored(kept, bench, fit, chosen)
    found = bench.fit(fit.model, chosen) or fit
    journal.keep(key, kept_form(found))
    return found


def _without_idle(
    bench: Bench,
    best: Fitted,
    chosen: tuple[Suspect, ...],
    refitted: Fitted,
    journal: Journal,
) -> tuple[tuple[Suspect, ...], Fitted]:
    """The effects less those that nobody misses, and the fit of those that stay."""
    worst = refitted.chi_square
    for suspect in chosen:
        others = tuple(each for each in chosen if each is not suspect)
        begun = _plain(bench, best)
        starts = {
            each.name: np.array(
                [best.model.at_the_door(p.split(".")[0])[p.split(".")[1]] for p in each.paths],
                float,
            )
            for each in others
        }
        found = bench.fit(begun, others, starts)
        if found is None:
            continue
        missed = found.chi_square - best.chi_square
        if missed < max(30.0, 0.02 * max(worst - best.chi_square, 0.0)):
            return others, _refit(bench, found, others, journal)
    return chosen, best


def kept_form(fit: Fitted) -> dict:
    """A fit as a journal keeps it."""
    return {
        "paths": list(fit.paths),
        "values": fit.values.tolist(),
        "covariance": fit.covariance.tolist(),
        "chi_square": fit.chi_square,
        "steps": fit.steps.tolist(),
        "converged": bool(fit.converged),
    }


def restored(kept: dict, bench: Bench, before: Fitted, extra: Sequence[Suspect]) -> Fitted:
    """A fit from a journal."""
    model = before.model
    for suspect in extra:
        model = suspect.beside(model)
        switched = {
            path: float(value)
            for path, value, free in zip(
                suspect.paths, suspect.probes[0], suspect.fitted, strict=True
            )
            if not free
        }
        model = model.replace(switched) if switched else model
    found = dict(zip(kept["paths"], kept["values"], strict=True))
    return Fitted(
        model.replace(found),
        tuple(suspect.name for suspect in extra),
        tuple(kept["paths"]),
        np.array(kept["values"]),
        np.array(kept["covariance"]),
        kept["chi_square"],
        np.array(kept["steps"]),
        kept["converged"],
    )
