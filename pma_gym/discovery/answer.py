"""The verdict, and everything that a diagnosis says, from what its steps found."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pma_gym.data.dataset import NamedTrial
from pma_gym.discovery.constancy import spread
from pma_gym.discovery.diagnosis import (
    Candidate,
    Diagnosis,
    Estimate,
    Moved,
    NamedEffect,
    Verdict,
)
from pma_gym.discovery.experiment import for_blind, next_experiment
from pma_gym.discovery.fits import Bench, Fitted
from pma_gym.discovery.floors import Level
from pma_gym.discovery.held_out import Unseen
from pma_gym.discovery.parameters import unit, values
from pma_gym.discovery.quantisation import coarse_sensors
from pma_gym.discovery.records import floors_at_the_door, gaps, trial_records
from pma_gym.discovery.residual_laws import Drawn, drawn_laws, residual_law
from pma_gym.discovery.rivals import Rival
from pma_gym.discovery.screening import Look
from pma_gym.discovery.selection import LEAST_CHANGE, Selection, passes
from pma_gym.discovery.slowness import leftover_share
from pma_gym.discovery.suspects import Suspect
from pma_gym.discovery.verdict_words import sentence, steps, unidentified
from pma_gym.discovery.where import localise
from pma_gym.plant.model import Model, Note

Progress = Callable[[str, int, int], None]

MOST_LEFT = 0.35
"""Share of what was slow in the residual that may be left by effects that explain it."""

DOUBTFUL = 0.08
"""The same, from which on laws without a shape of their own are set against the effects."""

BETTER, BETTER_BY = 1.15, 60.0
"""By how much such a law must explain more than the effects to say that they are not it: a factor
on their gain in chi-square, and chi-square."""

MOST_SPREAD = 0.4
"""Most that an effect's size may scatter from trial to trial, as a share of it."""

MOST_RIVALS = 2
"""Most others that an effect may be confused with and still be named: groups of three."""

MUCH_EXPLAINED = 0.1
"""Share of chi-square that an effect could explain, from which on its not passing the gate means
that there are too few data, not that the structure is right."""

BLIND_SHARE = 0.6
"""Share of the catalogue that would not have shown, from which on silence says nothing."""

MOVED = 3.0
"""Standard errors by which a parameter must move to be said to have been off."""

MOVED_CHANGE = 0.1
"""Least rms change of the signals, over the noise, by which refitted parameters differ from those
that were given: below, they agree."""

DETERMINED = 0.7
"""A parameter whose standard error is a larger share of what was assumed of it beforehand is not
determined by the data."""


@dataclass(frozen=True)
class Findings:
    """What the steps of a diagnosis found.

    Attributes:
        named: the trials.
        given: the model.
        floors: noise of the four outputs.
        bench: with the noise as seen at rest.
        refitted: the model's own parameters refitted.
        selection: the effects.
        suspects: the catalogue.
        searched: whether effects were looked for.
        seed: of simulated chance.
        rivals: of each effect.
        unseen: what the amended model says of trials that it was not fitted to.
        unseen_without: the same without the effects.
    """

    named: tuple[NamedTrial, ...]
    given: Model
    floors: Sequence[Level]
    bench: Bench
    refitted: Fitted
    selection: Selection
    suspects: tuple[Suspect, ...]
    searched: bool
    seed: int
    rivals: tuple[tuple[Rival, ...], ...] = ()
    unseen: Unseen | None = None
    unseen_without: Unseen | None = None

    @property
    def looks(self) -> tuple[Look, ...]:
        """The first looks at the whole catalogue, the most promising first."""
        return self.selection.stages[0].looks if self.selection.stages else ()


def answer(found: Findings, tell: Progress) -> Diagnosis:
    """The diagnosis."""
    tell("putting the answer together", 0, 3)
    coarse = coarse_sensors(found.floors)
    left = leftover_share(found)
    laws = _laws(found, left)
    blind = tuple(
        look.suspect.name
        for look in found.looks
        if look.resolvable is None or look.resolvable > 1.0
    )
    verdict = _verdict(found, left, laws, blind, bool(coarse))
    fit = found.selection.fit
    effects = (*_effects(found), *coarse) if verdict == "effect" else ()
    model = _amended(found, verdict)
    tell("putting the answer together", 1, 3)
    where, maps = localise(
        found.bench.evidence(found.refitted.model),
        found.refitted,
        np.array([floor.level for floor in found.floors]),
        found.seed,
    )
    records = trial_records(found)
    tell("putting the answer together", 2, 3)
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence="",
        where=where,
        effects=effects,
        parameters=_moved(found, fit),
        gap=gaps(records),
        candidates=_candidates(found),
        next_experiment=_following(found, verdict, blind),
        model=model,
        given=found.given,
        not_identifiable=_not_identifiable(found, fit),
        blind=blind,
        law=residual_law(laws[0]) if verdict == "unknown" and laws else None,
        floors=floors_at_the_door(found),
        trials=records,
        maps=maps,
        warnings=_warnings(found),
    )
    return replace(
        diagnosis, sentence=sentence(diagnosis, left), steps=steps(found, diagnosis, left)
    )


def _gate(found: Findings) -> bool:
    """Whether anything passed the gate."""
    return bool(found.selection.stages and found.selection.stages[0].gate)


def _laws(found: Findings, left: float) -> list[Drawn]:
    """Laws without a shape of their own, where the effects leave room for one."""
    if not _gate(found) or (left < DOUBTFUL and not _scatters(found)):
        return []
    return drawn_laws(found.selection.bench, found.refitted)


def _scatters(found: Findings) -> bool:
    """Whether an effect that was selected is of another size in each trial."""
    selection = found.selection
    return any(
        spread(selection.bench, selection.fit, selection.chosen, place) > MOST_SPREAD
        for place in range(len(selection.chosen))
    )


def _outdone(found: Findings, laws: Sequence[Drawn]) -> bool:
    """Whether a law without a shape of its own explains more than the effects do."""
    if not laws:
        return False
    selection = found.selection
    evidence = selection.bench.evidence(found.refitted.model)
    before = evidence.sums(found.refitted.values, np.empty(0)).chi_square
    gain = before - selection.fit.chi_square
    return laws[0].gain > max(BETTER * gain, gain + BETTER_BY)


def _suspicious(found: Findings) -> bool:
    """Whether an effect could explain much, in too few data to rule chance out."""
    if _gate(found) or not found.looks:
        return False
    best = found.looks[0]
    return best.change >= LEAST_CHANGE and best.gain > MUCH_EXPLAINED * found.refitted.chi_square


def _verdict(
    found: Findings, left: float, laws: Sequence[Drawn], blind: Sequence[str], coarse: bool
) -> Verdict:
    chosen = found.selection.chosen
    gate = _gate(found)
    if gate and (left > MOST_LEFT or _scatters(found) or _outdone(found, laws)):
        return "unknown"
    if gate and not chosen:
        return "undecidable"
    if chosen:
        undecided = any(
            sum(rival.equal for rival in rivals) > MOST_RIVALS for rivals in found.rivals
        )
        return "undecidable" if undecided or not _confirmed(found) else "effect"
    if coarse:
        return "effect"
    if _suspicious(found):
        return "undecidable"
    if found.searched and len(blind) > BLIND_SHARE * max(len(found.suspects), 1):
        return "undecidable"
    moved = any(each.significant for each in _moved(found, found.selection.fit).values())
    return "parameters" if moved and _change(found) > MOVED_CHANGE else "agrees"


def _confirmed(found: Findings) -> bool:
    """Whether the effects help on trials that the fits had not seen."""
    if found.unseen is None or found.unseen_without is None:
        return True
    with_it, without = found.unseen.chi_square, found.unseen_without.chi_square
    # By the number of trials too: one trial beyond what the others reach may weigh more than all.
    return bool(with_it.sum() < without.sum() or np.mean(with_it < without) > 0.5)


def _change(found: Findings) -> float:
    """Rms change of the signals by refitted parameters, over the noise, where that is most."""
    evidence = found.bench.evidence(found.given)
    both = np.stack([values(found.given, found.bench.own.free), found.refitted.values])
    columns = evidence.columns(both)
    if columns is None:
        return np.inf
    squares = sum(np.sum(part[1].astype(float) ** 2, axis=1) for part in columns)
    counts = sum(np.array(logged.measures) * float(len(logged.time)) for logged in evidence.logged)
    return float(np.sqrt(np.max(squares / np.maximum(counts, 1.0))))


def _effects(found: Findings) -> tuple[NamedEffect, ...]:
    """The effects that were selected."""
    fit, effects = found.selection.fit, []
    for place, suspect in enumerate(found.selection.chosen):
        stage = found.selection.stages[min(place, len(found.selection.stages) - 1)]
        look = next(each for each in stage.looks if each.suspect.name == suspect.name)
        equal = [rival.suspect.name for rival in found.rivals[place] if rival.equal]
        effects.append(
            NamedEffect(
                name=suspect.name,
                confused_with=tuple(equal),
                p_value=look.p_value,
                parameters={
                    path.partition(".")[2]: _estimate(found, fit, path)
                    for path in suspect.fitted_paths
                },
            )
        )
    return tuple(effects)


def _estimate(found: Findings, fit: Fitted, path: str) -> Estimate:
    """A parameter's value and 95 % interval, within its bounds."""
    value, error = fit.estimate(path)
    if not np.isfinite(error):
        return Estimate(value, None, None, unit(path))
    return Estimate(value, value - 1.96 * error, value + 1.96 * error, unit(path))


def _moved(found: Findings, fit: Fitted) -> Mapping[str, Moved]:
    """The model's own parameters that moved, the surest first; those that did not are left out."""
    start = values(found.given, found.bench.own.free)
    moved = {}
    for path, before in zip(found.bench.own.free, start, strict=True):
        value, error = fit.estimate(path)
        score = abs(value - before) / error if np.isfinite(error) and error > 0.0 else 0.0
        if score > 1.0:
            moved[path] = (
                score,
                Moved(float(before), _estimate(found, fit, path), bool(score > MOVED)),
            )
    return {path: each for path, (_, each) in sorted(moved.items(), key=lambda item: -item[1][0])}


def _not_identifiable(found: Findings, fit: Fitted) -> Mapping[str, str]:
    """Parameters that the data do not determine, with the reason."""
    reasons = {}
    for path, prior in zip(found.bench.own.free, found.bench.own.prior, strict=True):
        _, error = fit.estimate(path)
        if not np.isfinite(error) or error > DETERMINED * prior:
            reasons[path] = unidentified(path, fit, found.bench.own)
    return reasons


def _candidates(found: Findings) -> tuple[Candidate, ...]:
    """The whole catalogue, what was added first, then by what each could explain."""
    if not found.selection.stages:
        return ()
    stage = found.selection.stages[0]
    chosen = [suspect.name for suspect in found.selection.chosen]
    gains = _held_out_gains(found)
    listed = []
    for each in stage.looks:
        name = each.suspect.name
        fit = stage.fits.get(name)
        gain = each.gain if fit is None else stage.before.chi_square - fit.chi_square
        candidate = Candidate(
            name=name,
            delta_log_likelihood=0.5 * gain,
            held_out_gain=gains.get(name),
            p_value=each.p_value,
            change=each.change,
            resolvable=each.resolvable,
            fitted=fit is not None,
            why=_why(found, each, name in chosen),
        )
        listed.append(candidate)
    return tuple(
        sorted(listed, key=lambda c: (c.name not in chosen, not c.fitted, -c.delta_log_likelihood))
    )


def _why(found: Findings, look: Look, chosen: bool) -> str:
    name = look.suspect.name
    if chosen:
        return "added to the model"
    for suspect, rivals in zip(found.selection.chosen, found.rivals, strict=True):
        for rival in rivals:
            if rival.suspect.name == name:
                if rival.equal:
                    return f"explains these data as well as {suspect.name}"
                return (
                    f"explains less than {suspect.name}, by a log-likelihood of "
                    f"{rival.behind / 2:.4g}"
                )
    if look.resolvable is None:
        return "these data could not show it at any size"
    if not passes(found.bench, look):
        if look.resolvable > 1.0:
            return f"would show from {look.resolvable:.2g} times its usual size on only"
        return "explains no more than chance would"
    return "explains less than what was added"


def _held_out_gains(found: Findings) -> Mapping[str, float]:
    """Gain in log-likelihood a reading on trials left out, for what was added."""
    if found.unseen is None or found.unseen_without is None or not found.selection.chosen:
        return {}
    gain = found.unseen_without.chi_square.sum() - found.unseen.chi_square.sum()
    count = sum(logged.count for logged in found.bench.evidence(found.given).logged)
    return {suspect.name: float(0.5 * gain / count) for suspect in found.selection.chosen}


def _amended(found: Findings, verdict: Verdict) -> Model:
    """The model with what was found, its intervals in its notes."""
    if verdict == "agrees":
        return found.given
    keep = verdict in ("effect", "unknown")
    fit = found.selection.fit if keep else found.refitted
    notes = dict(fit.model.notes)
    for path in fit.paths:
        value, error = fit.estimate(path)
        known = bool(np.isfinite(error))
        notes[path] = Note(
            f"fitted to {len(found.named)} trials by pma-gym diagnose",
            value - 1.96 * error if known else None,
            value + 1.96 * error if known else None,
        )
    return replace(
        fit.model,
        name=f"{found.given.name}_amended",
        title=f"{found.given.title}; amended by a diagnosis",
        notes=notes,
    )


def _following(found: Findings, verdict: Verdict, blind: Sequence[str]):  # noqa: ANN202
    """What to measure next: what tells the survivors apart, or shows what could not be seen."""
    bench, selection = found.selection.bench, found.selection
    for place, rivals in enumerate(found.rivals):
        equal = [rival for rival in rivals if rival.equal][:3]
        if equal:
            others = [
                (
                    rival.fit,
                    tuple(
                        rival.suspect if i == place else suspect
                        for i, suspect in enumerate(selection.chosen)
                    ),
                )
                for rival in equal
            ]
            return next_experiment(bench, [(selection.fit, selection.chosen), *others], found.seed)
    if verdict == "undecidable" and found.looks:
        dim = [look.suspect for look in found.looks if look.suspect.name in blind]
        if _suspicious(found):
            dim = [look.suspect for look in found.looks[:3]]
        return for_blind(found.bench, found.refitted, dim, found.looks)
    return None


def _warnings(found: Findings) -> tuple[str, ...]:
    words = []
    if not found.selection.fit.converged:
        words.append("the last fit stopped before it had converged; its intervals are rough")
    if found.unseen is None:
        words.append(
            "with one trial nothing can be left out: the gap after the amendment is that of the "
            "data it was fitted to"
        )
    return tuple(words)
