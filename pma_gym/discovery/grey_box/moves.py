"""Screening of what a model may lack: what is worth a fit."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move, added_paths
from pma_gym.discovery.grey_box.latent_law import line_over_position
from pma_gym.discovery.grey_box.prepared_trials import CLOCK, PreparedTrials
from pma_gym.discovery.grey_box.slots import gains_of_drive, quantity_of, slot, values_of
from pma_gym.discovery.grey_box.thresholds import LEAST_TRIALS, ODD, TRIED
from pma_gym.estimation.innovations import TREND, TRIAL
from pma_gym.estimation.likelihood_fit import OTHERS, STEP, Coordinate, with_tied, with_values
from pma_gym.estimation.smoother import smoothed

Array = NDArray[np.float64]

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
        hide (`_beside`).
        """
        moves, bent = self._moves(now), self.trials.is_bent(now.fit.point)
        if bent and not now.moves:
            # A model that lacks much is bent by its fit: its lack is looked for from the model as
            # it came too.
            fresh = [
                replace(move, start=self.unmoved.fit.point)
                for move in self._moves(self.unmoved)
                if move.candidate
            ]
            moves = [*moves[:TRIED], *fresh[:TRIED], *moves[TRIED:]]
            return moves[: 2 * TRIED] + _beside(now, moves, 2 * TRIED)
        price = 0.5 * (0.5 * np.log(now.readings) + np.log(len(moves)))
        if not bent:
            return [move for move in moves[:TRIED] if move.promise > price]
        return moves[:TRIED] + _beside(now, moves, TRIED)

    def _moves(self, now: Hypothesis) -> list[Move]:
        """All that may be added, by what it promises less its price, the most first."""
        fitted, box = now.fit, now.box
        own = {c.name for c in fitted.coordinates}
        drive = [
            Coordinate(name, abs(fitted.point.numbers[name]))
            for name in gains_of_drive(self.trials.model)
            if name not in own
        ]
        clock = [] if CLOCK.name in own else [CLOCK]
        mean = [
            *drive,
            *clock,
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
        basis = np.linalg.qr(slopes[len(drive) + len(clock) :].T)[0]

        def beyond(rows: Array) -> Array:
            return rows - (rows @ basis) @ basis.T

        left = beyond(error)
        moves = [
            *self._effects(now, error, left, beyond),
            *_by_trial(now, mean, slopes, left, beyond),
        ]
        for each, slope in zip(clock, slopes[len(drive) :], strict=False):
            moves += _varying(each.name, slope, left, beyond)
        price = 0.5 * np.log(len(error))
        return sorted(moves, key=lambda move: move.numbers * price - move.promise)

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

    The clock, each parameter of the trial whose latent force stands out, and each that may differ
    as the most promising one does: in that trial, or from trial to trial. A drive's gain that falls
    is a friction, an inertia and a damping that rise, and none of these promises as much as all.
    """
    forces = np.array(now.fit.point.forces)
    odd = int(np.argmax(forces))
    alone = len(forces) >= LEAST_TRIALS and forces[odd] > ODD * float(np.median(forces))
    ends = [f"{TRIAL}{odd}"] if alone else []
    marks = (re.split(f"(?=[{TREND}{TRIAL}])", m.name)[-1] for m in moves[:first] if _differs(m))
    ends += [*marks][:1]
    return [
        m
        for m in moves[first:]
        if m.is_nuisance or _differs(m) and any(m.name.endswith(end) for end in ends)
    ]


def _differs(move: Move) -> bool:
    """Whether it is a parameter that differs by trial."""
    return bool(move.slots) and not move.is_nuisance
