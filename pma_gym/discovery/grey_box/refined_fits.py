"""Fits of a hypothesis in other words: fuller laws, other commands between rows, a trend."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.effect_fits import SLIPS, tried
from pma_gym.discovery.grey_box.first_fit import SHARES, hold_fits, weaker
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move, precise_fit
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.slots import quantity_of, slot, values_of
from pma_gym.discovery.grey_box.thresholds import LIKE, LINE
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import TREND, TRIAL, log_likelihood, value_in_trial
from pma_gym.estimation.likelihood_fit import OTHERS, Coordinate, value_of, with_tied, with_values

WIDER = (1.0, 0.2, 5.0)
"""Times the usual shape (a Stribeck speed) from which the fuller law of an effect is fitted."""


def refined(trials: PreparedTrials, now: Hypothesis) -> Hypothesis:
    """With the simpler laws of the added effects freed where that is worth its price."""
    for candidate in [move.candidate for move in now.moves if move.candidate]:
        law = CATALOGUE[candidate.effect]
        for row in (*law.ties, *law.terms):
            larger = _freed(trials, now, candidate, row, tie=row in law.ties)
            gain = larger.fit.value - now.fit.value
            numbers = len(larger.fit.coordinates) - len(now.fit.coordinates)
            if gain > now.price_of(numbers) + LIKE:
                now = larger
    return now


def _freed(
    trials: PreparedTrials,
    now: Hypothesis,
    candidate: CandidateEffect,
    row: Sequence[str],
    tie: bool,
) -> Hypothesis:
    """A hypothesis with the parameters of a tie, or of a further term, free."""
    point, effect = now.fit.point, candidate.effect
    names = [f"{effect}.{stem}" for stem in (row[1:] if tie else row)]
    probe = values_of(candidate.paths, candidate.probes[len(candidate.probes) // 2])
    tied = {slot_: of for slot_, of in now.fit.tied.items() if slot_ not in names}
    more, values = [], {}
    for path in candidate.paths:
        if (name := slot(path)) in names and path in candidate.fitted_paths:
            quantity = quantity_of(name)
            low, high = (quantity.to_si(end) for end in (quantity.lower, quantity.upper))
            follows = now.fit.tied.get(name)
            values[name] = 0.8 * point.numbers[follows] if follows else probe[name]
            more.append(Coordinate(name, abs(values[name]) or 1.0, False, low, high))
    if not more:
        return now
    # What is free already begins again from other shapes.
    coordinates = {c.name: c for c in (*now.fit.coordinates, *more)}.values()
    # The simpler law has made up for what it lacks, by its presliding distance too.
    slips = {
        name: [value, *(share * quantity_of(name).to_si(usual) for share in SLIPS)]
        for name, value in point.numbers.items()
        if name.startswith(f"{effect}.presliding") and (usual := quantity_of(name).usual)
    }
    starts = []
    for wide in WIDER:
        shaped = {n: v * (1.0 if n in now.fit.tied else wide) for n, v in values.items()}
        begin = weaker(trials, with_values(point, with_tied(shaped, tied)), 0.3)
        starts += [
            with_values(begin, dict(zip(slips, way, strict=True)))
            for way in (product(*slips.values()) if slips else [()])
        ]
    likely = log_likelihood(now.box.innovations(starts), now.box.rows)
    best = now
    for i in np.argsort(-likely)[: len(WIDER)]:
        made = precise_fit(trials, now.box, starts[i], list(coordinates), tied, rough=True)
        best = made if made.fit.value > best.fit.value else best
    return again(trials, replace(now, box=best.box, fit=best.fit), best)


def other_hold(trials: PreparedTrials, now: Hypothesis) -> Hypothesis:
    """The same hypothesis, with commands between rows the other way if that is likelier."""
    kinds = trials.linear, not trials.linear
    fits = [(made, kind) for kind in kinds for made in hold_fits(trials, now, kind)]
    made, linear = max(fits, key=lambda pair: pair[0].fit.value)
    if made.fit.value < now.fit.value + LIKE:
        return now
    trials.linear = linear
    return made


def trend_instead(trials: PreparedTrials, now: Hypothesis) -> Hypothesis:
    """With a trend in place of values that a parameter has by trial.

    Of several, or one beside a trend, where all trials' values lie on a line; of one where that is
    likelier.
    """
    slots = [slot_ for move in now.moves for slot_ in move.slots]
    of = [slot_.partition(TRIAL)[0].removesuffix(TREND) for slot_ in slots]
    alone = {name.partition(TRIAL)[0] for name in slots if TRIAL in name}
    for base in {each for each in of if each in alone}:
        marked = f"{base}{TRIAL}", f"{base}{TREND}"
        gone = {name for name in now.fit.point.numbers if name.startswith(marked)}
        gone |= {slot_ for slot_, name in now.fit.tied.items() if name in gone}
        numbers = {n: v for n, v in now.fit.point.numbers.items() if n not in gone}
        less = replace(
            now.fit,
            point=replace(now.fit.point, numbers=numbers),
            coordinates=tuple(c for c in now.fit.coordinates if c.name not in gone),
            tied={n: of_ for n, of_ in now.fit.tied.items() if n not in gone},
        )
        kept = tuple(move for move in now.moves if not gone & set(move.slots))
        order, numbered = now.box.order, range(len(now.box.rows))
        values = [value_in_trial(now.fit.point, base, i, order) for i in numbered]
        off = values - np.polyval(np.polyfit(order, values, 1), order)
        is_line, one = np.abs(off).max() < LINE * np.ptp(values), of.count(base) == 1
        if one or is_line:
            move = Move(f"{base}{TREND}", 0.0, 1, slots=(f"{base}{TREND}",))
            begin = Hypothesis(now.box, less, kept, now.rivals)
            made = tried(trials, begin, move, careful=True)
            now = now if one and made.fit.value < now.fit.value else made
    return now


def without(trials: PreparedTrials, base: Hypothesis, now: Hypothesis, gone: Move) -> Hypothesis:
    """A hypothesis without a move and what needs it, fitted from where it ended with it."""
    effect = f"{gone.candidate.effect}." if gone.candidate else "\0"
    stay = [
        move is not gone and not any(name.startswith(effect) for name in move.slots)
        for move in now.moves
    ]
    moves = tuple(move for move, stays in zip(now.moves, stay, strict=True) if stays)
    model = base.box.model
    for move in moves:
        model = move.candidate.beside(model) if move.candidate else model

    def stays(name: str) -> bool:
        return not name.startswith(effect) and name not in gone.slots

    made = now.fit
    point = replace(made.point, **{name: 0.0 for name in gone.slots[:1] if name in OTHERS})
    numbers = {name: value for name, value in point.numbers.items() if stays(name)}
    tied = {name: of for name, of in made.tied.items() if stays(name) and stays(of)}
    numbers = {name: v for name, v in numbers.items() if name not in made.tied or name in tied}
    free = [c for c in made.coordinates if stays(c.name)]
    box = trials.box(model)
    start = replace(point, numbers={**box.numbers(), **numbers})
    starts = [
        replace(start, forces=tuple(max(share * trials.force, each) for each in point.forces))
        for share in (0.0, *SHARES)
    ]
    box = trials.precise(model, start, now.box.rows[0].steps)
    likely = log_likelihood(box.innovations(starts), box.rows)
    less = precise_fit(trials, box, starts[int(np.argmax(likely))], free, tied)
    rivals = [rival for rival, stays in zip(now.rivals, stay, strict=False) if stays]
    return replace(less, moves=moves, rivals=tuple(rivals), alike=now.alike if stay[-1] else ())


def again(trials: PreparedTrials, now: Hypothesis, larger: Hypothesis) -> Hypothesis:
    """A hypothesis fitted again from where another one ended."""
    shared = {c.name for c in larger.fit.coordinates}
    values = {
        c.name: value_of(larger.fit.point, c.name) for c in now.fit.coordinates if c.name in shared
    }
    start = with_values(now.fit.point, with_tied(values, now.fit.tied))
    made = precise_fit(trials, now.box, start, now.fit.coordinates, now.fit.tied)
    best = max(made, now, key=lambda each: each.fit.value)
    return replace(now, box=best.box, fit=best.fit)
