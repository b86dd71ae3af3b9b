"""The diagnosis of a free rig from its trials."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.answer.estimates import rival_model
from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.fitting.journal import Journal
from pma_gym.discovery.grey_box.conclusions import Conclusions
from pma_gym.discovery.grey_box.effect_selection import EffectSelection
from pma_gym.discovery.grey_box.first_fit import first_fit
from pma_gym.discovery.grey_box.hum import without_hum
from pma_gym.discovery.grey_box.kept_fits import kept_in
from pma_gym.discovery.grey_box.latent_law import drafted_effect
from pma_gym.discovery.grey_box.next_trial import next_trial
from pma_gym.discovery.grey_box.predictions import Predictions
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.proposal import Proposal
from pma_gym.discovery.grey_box.sentence import sentence
from pma_gym.discovery.grey_box.slots import path_of, quantity_of, with_numbers
from pma_gym.discovery.grey_box.thresholds import MATERIAL
from pma_gym.discovery.report.effect_text import effect_name
from pma_gym.discovery.report.figure_text import figure, listed
from pma_gym.discovery.result.estimates import Approximate, Covariance, RivalModel
from pma_gym.discovery.result.noise import Floor, Nuisance
from pma_gym.estimation.innovations import TREND, TRIAL
from pma_gym.estimation.likelihood_fit import Fit, value_of
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS


def diagnosis(conclusions: Conclusions, propose: bool) -> Diagnosis:
    """The answer with its conclusions, and the next experiment where one is to be proposed."""
    following, none_helps = next_trial(conclusions) if propose else (None, "")
    base, last = conclusions.predictions.path[0], conclusions.proposal.last
    named = conclusions.verdict == "effect"
    floors = {}
    for i, channel in enumerate(base.box.channels):
        column = BY_QUANTITY[conclusions.selection.trials.model.rig.signals[channel].name]
        value, step = (
            v / SI_FACTORS[column.unit]
            for v in (
                last.fit.point.noises[i],
                conclusions.selection.trials.steps_of_readings[i],
            )
        )
        floors[column.name] = Floor(value, "innovations", {"innovations": value}, step, ())
    approximate = conclusions.proposal.share(last) > MATERIAL and bool(conclusions.effects)
    return Diagnosis(
        verdict=conclusions.verdict,
        sentence=sentence(conclusions),
        where=(),
        effects=conclusions.effects if named else (),
        parameters=conclusions.parameters,
        gap=conclusions.gap,
        candidates=(),
        next_experiment=following,
        model=conclusions.model,
        given=conclusions.selection.trials.model,
        covariance=covariance_of(
            conclusions.written.fit, conclusions.model, conclusions.selection.trials.model
        ),
        rivals=rival_models(conclusions),
        approximate=Approximate(
            conclusions.effects, conclusions.proposal.left, conclusions.predictions.holds_out(last)
        )
        if approximate
        else None,
        law=conclusions.law if conclusions.verdict == "unknown" or approximate else None,
        draft=drafted_effect(conclusions.law, conclusions.selection.trials.model.rig)
        if conclusions.verdict == "unknown" and conclusions.law
        else "",
        tones={conclusions.selection.trials.model.plant: conclusions.line[0]}
        if conclusions.verdict == "unknown" and conclusions.line
        else {},
        floors=floors,
        nuisances=_nuisances(conclusions),
        states=conclusions.states,
        trials=conclusions.records,
        steps=_steps(conclusions),
        warnings=(*([WORSE] if conclusions.proposal.is_worse else []), *filter(None, [none_helps])),
    )


def _nuisances(conclusions: Conclusions) -> tuple[Nuisance, ...]:
    """Hums of the sensors, the colour of their noise and the readings' clock."""
    trials, point = conclusions.selection.trials, conclusions.proposal.last.fit.point
    columns = [BY_QUANTITY[trials.model.rig.signals[c].name].name for c in trials.channels]
    sizes = [
        hum.amplitude / 2.0**0.5 / point.deviations[trials.channels.index(hum.channel)]
        for hum in trials.hums
    ]
    hums = [
        Nuisance("line", {columns[trials.channels.index(hum.channel)]: size}, hum.hertz)
        for hum, size in zip(trials.hums, sizes, strict=True)
    ]
    clock = [Nuisance("clock", dict.fromkeys(columns, point.clock))] if point.clock else []
    kept = np.exp(-trials.span / trials.stride / trials.block / point.colour_memory)
    alike = {columns[0]: float(kept * (point.colour / point.noises[0]) ** 2)}
    colour = [Nuisance("coloured noise", alike)] if point.colour else []
    return (*hums, *clock, *colour)


def rival_models(conclusions: Conclusions) -> tuple[RivalModel, ...]:
    """Models with another effect in the place of the last one, which were worth as much."""
    last, written = conclusions.proposal.last, conclusions.model
    move = last.moves[-1].candidate if last.moves else None
    if conclusions.verdict != "effect" or move is None or move.effect not in written.parameters:
        return ()
    models = []
    for each in last.alike:
        rival = each.moves[-1].candidate
        if rival is not None:
            fitted = with_numbers(each.box.model, each.fit.point.numbers)
            known = covariance_of(each.fit, fitted, conclusions.selection.trials.model)
            models.append(rival_model([rival], [move], written, fitted, known))
    return tuple(model for model in models if model is not None)


def covariance_of(made: Fit, written: Model, given: Model) -> Covariance:
    """Of the fitted parameters that a written model has, tied ones as those that they follow."""
    names = [coordinate.name for coordinate in made.coordinates]
    slots = {**{name: name for name in names}, **made.tied, "drive_delay.delay": "delay"}
    rows: dict[str, int] = {}
    errors = []
    for slot, of in slots.items():
        effect, _, stem = slot.partition(".")
        many = any(mark in slot for mark in (TRIAL, TREND, "["))
        # How far a contact gives before it slides is no parameter that is said.
        if (
            not stem
            or many
            or of not in names
            or (stem == "presliding" and effect in given.parameters)
        ):
            continue
        if (path := path_of(slot)) in set(written.paths()):
            quantity, value = quantity_of(slot), value_of(made.point, of)
            rows[path] = names.index(of)
            low, high = (quantity.from_si(v) for v in (value, value + made.deviations[of]))
            errors.append(high - low)
    at = list(rows.values())
    return Covariance.of(list(rows), errors, made.curvature[np.ix_(at, at)])


WORSE = (
    "predictions of the refitted model miss by more than those of the model as given, so that one "
    "is what model.toml has"
)
"""Said where a refit is not written."""


MOST_SHOWN = 6
"""Fits that a page lists, those that gained most."""


def _steps(conclusions: Conclusions) -> tuple[str, ...]:
    """What was fitted, the greatest gain first."""

    def words(name: str) -> str:
        base, _, number = name.partition(TRIAL)
        if number:
            return f"{path_of(base)} in {conclusions.named[int(number)].name} alone"
        if name.endswith(TREND):
            return f"a trend of {path_of(name.removesuffix(TREND))}"
        return effect_name(name)

    gains = sorted(conclusions.selection.gains.items(), key=lambda pair: -pair[1])
    said = [f"{words(name)} {figure(gain)}" for name, gain in gains[:MOST_SHOWN] if gain > 0.0]
    if not said:
        return ("Nothing that was fitted beside the model gains any log likelihood.",)
    return (f"Fitted beside the model, with the gain of log likelihood at first: {listed(said)}.",)


def answered(
    model: Model,
    named: Sequence[NamedTrial],
    candidates: Sequence[CandidateEffect] | None,
    tolerance: Mapping[str, float],
    seed: int,
    tell: Callable[[str, int, int], None],
    threads: int,
    journal: Journal,
    propose: bool,
) -> Diagnosis:
    """The diagnosis of a free rig.

    Args:
        model: the model as it came.
        named: the trials.
        candidates: effects that may be missing; None: only the model's own parameters are fitted.
        tolerance: misfit that is good enough (SI), by measurement.
        seed: of the starts of fits.
        tell: called with a step's name, what is done of it and its total.
        threads: that filters run in at once.
        journal: keeps fits.
        propose: whether to look for the next experiment too.
    Raises:
        TrialError: trials with fewer readings than a fit needs.
    """
    logged = [Logged.of(model, i, each.trial) for i, each in enumerate(named)]
    trials = without_hum(PreparedTrials(model, logged, threads))
    selection = EffectSelection(trials, candidates or (), seed, tell)
    limits = {
        BY_QUANTITY[name].name: value / SI_FACTORS[BY_QUANTITY[name].unit]
        for name, value in tolerance.items()
    }
    with kept_in(journal):
        path = [first_fit(trials, seed, tell)] if candidates is None else selection.run()
        tell("putting the answer together", 0, 1)
        predictions = Predictions(trials, path, tell)
        proposal = Proposal(selection, predictions, candidates or ())
        conclusions = Conclusions(selection, predictions, proposal, named, limits)
        return diagnosis(conclusions, propose)
