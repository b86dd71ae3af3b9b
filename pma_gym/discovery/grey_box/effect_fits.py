"""Fits of a hypothesis with one thing more."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pma_gym.discovery.fitting.free_law import free_law
from pma_gym.discovery.grey_box.first_fit import LESS, weaker
from pma_gym.discovery.grey_box.hypothesis import (
    FREE_LAWS,
    Hypothesis,
    Move,
    added_paths,
    precise_fit,
)
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.slots import presliding, quantity_of, slot, values_of
from pma_gym.discovery.grey_box.thresholds import LIKE, ODD
from pma_gym.discovery.result.misfit import rms
from pma_gym.effects import CATALOGUE
from pma_gym.effects.residual_law import HEIGHTS
from pma_gym.estimation.innovations import TREND, TRIAL, GreyBox, Point, log_likelihood
from pma_gym.estimation.likelihood_fit import Coordinate, value_of, with_tied, with_values
from pma_gym.estimation.smoother import smoothed

PARTS, SLIPS = (0.3, 1.0, 3.0), (0.01, 0.1, 1.0, 10.0, 100.0)
"""Starts of a candidate: times the size that the screening promises, and times the usual presliding
distance."""

FITTED, FURTHER = 1, 2
"""How many of them are fitted, the likeliest as they are, and in a careful fit."""

AMOUNTS = (-0.5, -0.3, 0.0, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0)
"""By how many times itself a parameter of an odd trial may differ where its fits begin."""

PROMISED = (0.0, 0.5, 1.0, 2.0)
"""Times what the screening promises that a parameter differs by trial where its fits begin."""

HIGHEST = 3.0
"""Standard deviation of a free law's heights, in latent forces, so that none of it makes up for an
offset of the drive. Assumption."""

MOST_FACTOR = 5.0
"""Factor that a parameter of one trial may differ by.

Beyond it no cable chain jams, and another thing is missing.
"""


def tried(trials: PreparedTrials, now: Hypothesis, move: Move, careful: bool = False) -> Hypothesis:
    """Fit with a move added; `careful` from further starts."""
    candidate = move.candidate
    if move.is_nuisance:
        start = move.start or now.fit.point
        free = [*now.fit.coordinates, *trials.logging(move.name)]
        made = precise_fit(trials, now.box, start, free, now.fit.tied, rough=not careful)
        return replace(made, moves=(*now.moves, move), rivals=now.rivals)
    if candidate is None:
        return _varied(trials, now, move, careful)
    box = trials.box(candidate.beside(now.box.model), steps=now.box.rows[0].steps)
    law, tied = CATALOGUE[candidate.effect], dict(now.fit.tied)
    tied |= {f"{candidate.effect}.{tie[1]}": f"{candidate.effect}.{tie[0]}" for tie in law.ties}
    absent = values_of(candidate.paths, candidate.absent)
    at = values_of(
        candidate.paths, candidate.grown(move.probe, float(np.clip(move.amount, -20.0, 20.0)))
    )
    at |= {
        n: absent[n] for term in law.terms for n in [f"{candidate.effect}.{term[0]}"] if n in absent
    }
    lower, upper = candidate.bounds
    reach = np.abs(candidate.probes - candidate.absent).max(axis=0)
    more = []
    for path, low, high, far in zip(candidate.paths, lower, upper, reach, strict=True):
        if path in added_paths(candidate):
            zero, size, least, most = (
                quantity_of(slot(path)).to_si(float(v)) for v in (0.0, far, low, high)
            )
            more.append(Coordinate(slot(path), abs(size - zero) or 1.0, False, least, most))
    more += [presliding(candidate.effect)] if "presliding" in law.scanned else []
    here = move.start or now.fit.point
    whole = replace(here, numbers={**box.numbers(), **here.numbers})
    sized = [slot(p) for p, size in zip(candidate.paths, candidate.amplitudes, strict=True) if size]
    starts = _starts(trials, box, whole, at, absent, sized, more, tied)
    coordinates = [*now.fit.coordinates, *more]
    chosen = starts[FITTED:][:FURTHER] if careful else starts[:FITTED]
    fits = [
        precise_fit(trials, box, start, coordinates, tied, rough=not careful) for start in chosen
    ]
    if all(made.fit.value < now.fit.value for made in fits):
        # From none of it, a fit is no less likely than without.
        none = with_values(whole, with_tied({**at, **absent}, tied))
        fits += [precise_fit(trials, box, none, coordinates, tied, rough=True)]
    best = max(fits, key=lambda made: made.fit.value)
    return replace(best, moves=(*now.moves, move), rivals=now.rivals)


def _starts(
    trials: PreparedTrials,
    box: GreyBox,
    whole: Point,
    at: Mapping[str, float],
    absent: Mapping[str, float],
    sized: Sequence[str],
    more: Sequence[Coordinate],
    tied: Mapping[str, str],
) -> list[Point]:
    """Starts of a candidate's fit, the likeliest as they are first.

    One for each presliding distance, else for each latent force: these lead to other optima.
    """
    slips = [c for c in more if c.name not in absent]
    points, kinds = [], []
    for part in PARTS:
        for less in LESS:
            for slip in SLIPS if slips else (1.0,):
                values = dict(at)
                for c in more:
                    size, share = absent.get(c.name, 0.0), part if c.name in sized else 1.0
                    values[c.name] = (
                        float(np.clip(whole.numbers[c.name] * slip, c.lower, c.upper))
                        if c in slips
                        else size + share * (at[c.name] - size)
                    )
                start = with_values(whole, with_tied(values, tied))
                points.append(weaker(trials, start, less))
                kinds.append(slip if slips else less)
    # Of the shortest way, where steps are to be the shortest.
    box = trials.precise(box.model, points[0], box.rows[0].steps)
    likely = log_likelihood(box.innovations(points), box.rows)
    order = np.argsort(-likely)
    first = {kind: at for at, kind in reversed([(i, kinds[i]) for i in order])}
    return [points[i] for i in order if first[kinds[i]] == i]


def free_laws(trials: PreparedTrials, base: Hypothesis) -> list[Hypothesis]:
    """With each law of free shape (`FREE_LAWS`) alone."""
    point, made = base.fit.point, list[Hypothesis]()
    states = [smoothed(base.box, point, i) for i in range(len(base.box.rows))]
    places, speeds = ([getattr(e, name) for e in states] for name in ("position", "speed"))
    ways = places, speeds, places
    for name, values in zip(FREE_LAWS[trials.model.plant], ways, strict=True):
        unit = CATALOGUE[name].quantities["first"]
        least, most = (unit.from_si(float(end(np.concatenate(values)))) for end in (np.min, np.max))
        candidate = free_law(base.box.model, name, (least, most))
        box = trials.box(candidate.model, steps=base.box.rows[0].steps)
        whole = replace(point, numbers={**box.numbers(), **point.numbers})
        # A damping's force is as large at the speed's root mean square.
        speed = rms(np.concatenate(speeds)) if "damping" in name else 1.0
        size = max(point.forces) / speed
        own = [Coordinate(slot(path), size, prior=HIGHEST) for path in candidate.paths]
        free, halves = [*base.fit.coordinates, *own[:HEIGHTS]], own[HEIGHTS:]
        starts = [weaker(trials, whole, less) for less in (LESS[0], LESS[-1])]
        fits = [precise_fit(trials, box, each, free, base.fit.tied, rough=True) for each in starts]
        best = max(fits, key=lambda each: each.fit.value)
        if halves:
            start, free = best.fit.point, [*free, *halves]
            finer = precise_fit(trials, best.box, start, free, base.fit.tied, rough=True)
            if finer.fit.value > best.fit.value + base.price_of(len(halves)) + LIKE:
                best = finer
        made.append(replace(best, moves=(*base.moves, Move(name, 0.0, len(own), candidate))))
    return made


def _varied(trials: PreparedTrials, now: Hypothesis, move: Move, careful: bool) -> Hypothesis:
    """Fit with a parameter that differs by trial.

    From more starts where the latent force of that trial stands out.
    """
    (name,) = move.slots
    forces = np.array(now.fit.point.forces)
    odd = name.endswith(f"{TRIAL}{int(np.argmax(forces))}") and forces.max() > ODD * float(
        np.median(forces)
    )
    mark = TREND if TREND in name else TRIAL
    base, _, number = name.partition(mark)
    value = value_of(now.fit.point, base)
    old = next((c for c in now.fit.coordinates if c.name == base), Coordinate(base, abs(value)))
    scale = abs(value) if old.logarithmic else old.scale
    ends = sorted((value / MOST_FACTOR, value * MOST_FACTOR))
    alone = max(old.lower, ends[0]), min(old.upper, ends[1])
    first, bounds = (0.0, (-np.inf, np.inf)) if mark == TREND else (value, alone)
    tied = dict(now.fit.tied)
    tied_slots = [slot_ for slot_, of in now.fit.tied.items() if of == base]
    tied |= {f"{tied_slot}{mark}{number}": name for tied_slot in tied_slots}
    coordinates = [*now.fit.coordinates, Coordinate(name, scale, False, *bounds)]
    # The likeliest of what it may be beside a share of the latent force.
    differ = [first + times * move.amount * scale for times in PROMISED]
    if odd and mark == TRIAL:
        differ += [value + times * abs(value) for times in AMOUNTS]
    here = [
        replace(
            with_values(now.fit.point, with_tied({name: there}, tied)),
            forces=tuple(share * force for force in now.fit.point.forces),
        )
        for there in np.clip(differ, *bounds).tolist()
        for share in (1.0, *LESS)
    ]
    likely = log_likelihood(now.box.innovations(here), now.box.rows)
    starts = [here[i] for i in np.argsort(-likely)[: 1 + careful]]
    if careful or mark == TREND:
        # A trend carries the latent force of all trials.
        none = with_values(now.fit.point, with_tied({name: first}, tied))
        starts += [weaker(trials, none, LESS[0])]
    fits = [
        precise_fit(trials, now.box, start, coordinates, tied, rough=not careful)
        for start in starts
    ]
    best = max(fits, key=lambda made: made.fit.value)
    return replace(best, moves=(*now.moves, move), rivals=now.rivals)
