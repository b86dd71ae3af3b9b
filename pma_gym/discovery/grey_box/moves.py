"""Screening of what a model may lack: what is worth a fit."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.effect_fits import SLIPS
from pma_gym.discovery.grey_box.first_fit import LESS, SHARES
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move, added_paths
from pma_gym.discovery.grey_box.latent_law import line_over_position
from pma_gym.discovery.grey_box.prepared_trials import CLOCK, PreparedTrials
from pma_gym.discovery.grey_box.slots import gains_of_drive, quantity_of, slot, values_of
from pma_gym.discovery.grey_box.thresholds import LEAST_TRIALS, LIKE, ODD, TRIED
from pma_gym.estimation.innovations import COLOUR, TREND, TRIAL, Point, log_likelihood
from pma_gym.estimation.likelihood_fit import OTHERS, STEP, Coordinate, with_tied, with_values
from pma_gym.estimation.smoother import smoothed

Array = NDArray[np.float64]

CLOCKS = (1e-4, 3e-4, 1e-3, 2e-3, 4e-3, 8e-3, 0.016, 0.03)
"""Shares by which a clock runs fast or slow where its fits begin."""

COLOURS, FADES = (0.1, 0.3, 1.0), 5
"""Noises, and number of memories, where the fits of coloured noise begin."""

NOTHING = 1e-9
"""Square of a change, in noises, that is none: rounding."""


@dataclass(frozen=True)
class Screening:
    """A screening of what may be added to a hypothesis.

    Attributes:
        trials: with the model as it came.
        candidates: effects that may be missing.
        unmoved: the model's own parameters as they came.
        tell: called with what is being done, what is done of it and its total.
    """

    trials: PreparedTrials
    candidates: Sequence[CandidateEffect]
    unmoved: Hypothesis
    tell: Callable[[str, int, int], None]

    def worth_a_fit(self, now: Hypothesis) -> list[Move]:
        """The moves that promise half their price.

        Where there is a latent force, the first ones whatever they promise, and those that it may
        hide (`_beside`, `_clocks`). Coloured noise wherever some of it is likelier (`_coloured`).
        """
        moves, bent = self._moves(now), self.trials.is_bent(now.fit.point)
        logging = [*(self._clocks(now) if bent else []), *self._coloured(now)]
        if bent and not now.moves:
            # A model that lacks much is bent by its fit: its lack is looked for from the model as
            # it came too.
            fresh = [
                replace(move, start=self.unmoved.fit.point)
                for move in self._moves(self.unmoved)
                if move.candidate
            ]
            moves = [*moves[:TRIED], *fresh[:TRIED], *moves[TRIED:]]
            return moves[: 2 * TRIED] + _beside(now, moves, 2 * TRIED) + logging
        price = 0.5 * (0.5 * np.log(now.readings) + np.log(len(moves)))
        if not bent:
            return [move for move in moves[:TRIED] if move.promise > price] + logging
        return moves[:TRIED] + _beside(now, moves, TRIED) + logging

    def _moves(self, now: Hypothesis) -> list[Move]:
        """All that may be added, by what it promises less its price, the most first."""
        fitted, box = now.fit, now.box
        own = {c.name for c in fitted.coordinates}
        drive = [
            Coordinate(name, abs(fitted.point.numbers[name]))
            for name in gains_of_drive(self.trials.model)
            if name not in own
        ]
        mean = [
            *drive,
            *(c for c in fitted.coordinates if " " not in c.name and c.name != "memory"),
        ]
        beside = [
            with_values(
                fitted.point, with_tied({c.name: c.value(c.of(fitted.point) + STEP)}, fitted.tied)
            )
            for c in mean
        ]
        white = self.trials.white(box, [fitted.point, *beside])
        error, slopes = white[0], np.nan_to_num((white[1:] - white[0]) / STEP)
        basis = np.linalg.qr(slopes[len(drive) :].T)[0]

        def beyond(rows: Array) -> Array:
            return rows - (rows @ basis) @ basis.T

        left = beyond(error)
        moves = [
            *self._effects(now, error, left, beyond),
            *_by_trial(now, mean, slopes, left, beyond),
        ]
        price = 0.5 * np.log(len(error))
        return sorted(moves, key=lambda move: move.numbers * price - move.promise)

    def _clocks(self, now: Hypothesis) -> list[Move]:
        """The readings' clock, where an error of it is likelier than none beside little force.

        What a latent force makes up for shows no slope, and fitted parameters may have made up for
        it too: it is looked for on a grid, beside these and those of the model as it came.
        """
        if any(c.name == CLOCK.name for c in now.fit.coordinates):
            return []
        point, moves = now.fit.point, []
        kinds = [[replace(point, forces=tuple(LESS[-1] * force for force in point.forces))]]
        kinds += [] if now.moves else [self._fresh(len(point.forces))]
        for bases in kinds:
            none, here = (
                [
                    replace(base, clock=error, delay=late * point.delay)
                    for error in errors
                    for base in bases
                    for late in (1.0, 0.0)
                ]
                for errors in ((0.0,), (*CLOCKS, *(-error for error in CLOCKS)))
            )
            likely = log_likelihood(now.box.innovations([*none, *here]), now.box.rows)
            best = int(np.argmax(likely[len(none) :]))
            gain = float(likely[len(none) + best] - likely[: len(none)].max())
            if gain > now.price_of(1) + LIKE:
                moves += [Move(CLOCK.name, gain, 1, slots=(CLOCK.name,), start=here[best])]
        return moves

    def _fresh(self, count: int) -> list[Point]:
        """The model as it came beside some latent force in so many trials.

        With the noise that readings show, and dry friction of any presliding distance.
        """
        noise, memory = tuple(self.trials.noise), self.trials.memory[0]
        point = replace(self.unmoved.fit.point, deviations=noise, memory=memory)
        slips = {n: v for n, v in point.numbers.items() if n.endswith(".presliding")}
        return [
            with_values(
                replace(point, forces=(share * self.trials.force,) * count),
                {name: times * value for name, value in slips.items()},
            )
            for share in SHARES[:2]
            for times in (SLIPS if slips else SLIPS[2:3])
        ]

    def _coloured(self, now: Hypothesis) -> list[Move]:
        """Coloured noise of the first signal, where some of it is likelier than none."""
        point = now.fit.point
        if point.colour:
            return []
        size, memory = self.trials.logging(COLOUR)
        kinds = product(
            [share * self.trials.noise[0] for share in COLOURS],
            np.geomspace(memory.lower, memory.upper, FADES).tolist(),
        )
        bases = [point, replace(point, forces=tuple(LESS[-1] * force for force in point.forces))]
        here = [
            replace(base, colour=deviation, colour_memory=fades)
            for deviation, fades in kinds
            for base in bases
        ]
        rows = now.box.rows
        likely, none = (log_likelihood(now.box.innovations(ps), rows) for ps in (here, bases))
        best, slots = int(np.argmax(likely)), (size.name, memory.name)
        gain = float(likely[best] - none.max())
        if gain < now.price_of(len(slots)) + LIKE:
            return []
        return [Move(COLOUR, gain, len(slots), slots=slots, start=here[best])]

    def _effects(
        self, now: Hypothesis, error: Array, left: Array, beyond: Callable[[Array], Array]
    ) -> list[Move]:
        added = {move.candidate.name for move in now.moves if move.candidate}
        moves = []
        for number, candidate in enumerate(self.candidates):
            self.tell("screening effects", number, len(self.candidates))
            if candidate.name in added:
                continue
            if candidate.lowest:
                candidate = _with_line(candidate, now)
            box = self.trials.box(candidate.beside(now.box.model), steps=now.box.rows[0].steps)
            whole = replace(now.fit.point, numbers={**box.numbers(), **now.fit.point.numbers})
            probes = self.trials.white(
                box,
                [with_values(whole, values_of(candidate.paths, row)) for row in candidate.probes],
            )
            best = Move(candidate.name, -np.inf, 0)
            for i, row in enumerate(probes):
                if not np.isfinite(row).all():
                    continue
                change = beyond(row - error)
                with np.errstate(over="ignore"):
                    square = float(change @ change)
                if not NOTHING < square < np.inf:
                    continue
                amount = -float(left @ change) / square
                if amount < 0.0 and not candidate.signs[i]:
                    continue
                if (promise := 0.5 * amount**2 * square) > best.promise:
                    best = Move(
                        candidate.name, promise, len(added_paths(candidate)), candidate, i, amount
                    )
            moves += [best] if best.candidate else []
        return moves


def _with_line(candidate: CandidateEffect, now: Hypothesis) -> CandidateEffect:
    """A candidate that is periodic over the position, probed at the latent force's line too."""
    (path,) = candidate.lowest
    line = line_over_position(
        [smoothed(now.box, now.fit.point, i) for i in range(len(now.box.rows))]
    )
    # One size each: a screening is in proportion to it. The first two are a quarter period apart.
    _, kept = np.unique(candidate.probes[:, ~candidate.amplitudes], axis=0, return_index=True)
    candidate = replace(candidate, probes=candidate.probes[kept], signs=candidate.signs[kept])
    probes, signs = candidate.probes[:2].copy(), candidate.signs[:2]
    probes[:, candidate.paths.index(path)] = quantity_of(slot(path)).from_si(line)
    probes = np.clip(probes, *candidate.bounds)
    return replace(
        candidate,
        probes=np.concatenate([candidate.probes, probes]),
        signs=np.concatenate([candidate.signs, signs]),
    )


def _by_trial(
    now: Hypothesis,
    mean: Sequence[Coordinate],
    slopes: Array,
    left: Array,
    beyond: Callable[[Array], Array],
) -> list[Move]:
    """Each parameter in one trial alone, with a trend over the trials."""
    count = len(now.box.rows)
    if count < LEAST_TRIALS:
        return []
    of = np.concatenate(
        [np.full(int(trial.there.sum()), i) for i, trial in enumerate(now.box.rows)]
    )
    moves = []
    for c, slope in zip(mean, slopes, strict=True):
        alone = TREND in c.name or TRIAL in c.name
        if alone or c.name in OTHERS or c.name.endswith("presliding"):
            continue
        columns = {f"{c.name}{TREND}": slope * now.box.order[of]}
        columns |= {f"{c.name}{TRIAL}{i}": slope * (of == i) for i in range(count)}
        for name, column in columns.items():
            moves += _varying(name, column, left, beyond)
    return moves


def _varying(name: str, column: Array, left: Array, beyond: Callable[[Array], Array]) -> list[Move]:
    """A further number whose derivative is a column; none where that tells nothing of it."""
    change = beyond(column)
    square = float(change @ change)
    if square <= NOTHING:
        return []
    amount = -float(left @ change) / square
    return [Move(name, 0.5 * amount**2 * square, 1, amount=amount, slots=(name,))]


def _beside(now: Hypothesis, moves: Sequence[Move], first: int) -> list[Move]:
    """Further moves behind the first ones.

    Each parameter of the trial whose latent force stands out, and each that may differ
    as the most promising one does: in that trial, or from trial to trial. A drive's gain that falls
    is a friction, an inertia and a damping that rise, and none of these promises as much as all.
    """
    forces = np.array(now.fit.point.forces)
    odd = int(np.argmax(forces))
    alone = len(forces) >= LEAST_TRIALS and forces[odd] > ODD * float(np.median(forces))
    ends = [f"{TRIAL}{odd}"] if alone else []
    marks = (re.split(f"(?=[{TREND}{TRIAL}])", m.name)[-1] for m in moves[:first] if m.slots)
    ends += [*marks][:1]
    return [m for m in moves[first:] if m.slots and any(m.name.endswith(end) for end in ends)]
