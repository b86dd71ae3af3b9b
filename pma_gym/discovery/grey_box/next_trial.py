"""The next trial of a slide or joint: the command that tells the likeliest rivals apart soonest.

A command runs through the range that the logs have, in several shapes, slower and faster, from
rest. Each rival predicts it. Where one of them is right, the filter of another has the innovations
w, in its own standard deviations, and its parameters take up what these logs leave open of them:

    log odds = 1/2 min_d |w + J d|^2 + d C^-1 d

with derivatives J and the covariance C of the fit. It counts for the pair, either way round, that
is hardest to tell.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.experiments.excitation import Excitation
from pma_gym.discovery.experiments.next_experiment import ExpectedOdds
from pma_gym.discovery.experiments.predicted_trials import proposal
from pma_gym.discovery.grey_box.conclusions import Conclusions
from pma_gym.discovery.grey_box.effect_fits import tried
from pma_gym.discovery.grey_box.hypothesis import Hypothesis
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.thresholds import LIKE
from pma_gym.discovery.report.effect_text import effect_names
from pma_gym.discovery.report.figure_text import figure, signal_name
from pma_gym.discovery.result.next_experiment import NextExperiment
from pma_gym.discovery.thresholds import RESOLVED, SETTLED
from pma_gym.estimation.innovations import (
    TREND,
    TRIAL,
    TURNS,
    GreyBox,
    Point,
    Rows,
    counted,
    is_rugged,
)
from pma_gym.estimation.likelihood_fit import STEP, with_tied, with_values
from pma_gym.estimation.logged import Logged
from pma_gym.plant.sensors import direct_command
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

MOST_RIVALS = 3
"""Beside the likeliest hypothesis."""

REACHES = (1.0, 2.0, 4.0)
"""Travels, in those of the logs, that a trial may take: the least that settles the question."""

SIZES = (1.0, 0.5, 0.25)
"""Shares of the commands' range that are tried."""

LONGEST_S = 20.0
"""Of a trial, but for one slow cycle; and of what it is reckoned from, the logs' trials."""

PERIODS = (2.0, 0.5, 0.125, 0.03125)
"""Of cycles, in trials of the logs; at least half a trial of them."""

SPEEDS = (0.5, 2.0)
"""At which the first trial's own commands are repeated."""

CYCLES = {
    "triangles": ((0.0, 0.25, 0.75, 1.0), (0.0, 1.0, -1.0, 0.0)),
    "steps to both ends": ((0.0, 0.02, 0.5, 0.52, 0.98, 1.0), (0.0, 1.0, 1.0, -1.0, -1.0, 0.0)),
    "steps with pauses": (
        (0.0, 0.02, 0.25, 0.27, 0.5, 0.52, 0.75, 0.77),
        (0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0, 0.0),
    ),
}
"""One cycle of a command: places, and shares of what there is to either side of its rest."""


def next_trial(conclusions: Conclusions) -> tuple[NextExperiment | None, str]:
    """What to measure next, and what to say where nothing within the logs' commands would help."""
    rivals, separates = _rivals(conclusions)
    if not rivals or conclusions.verdict == "unknown":
        return None, ""
    selection, best = conclusions.selection, None
    selection.tell("choosing the next experiment", 0, 1)
    question = Question(selection.trials, rivals)
    expected = [question.expected(*each) for each in _commands(conclusions)]
    for reach in REACHES:
        within = [odds for far, odds in expected if far <= reach]
        best = max(within, key=lambda each: each.rank, default=None)
        if best is not None and best.log_odds >= SETTLED:
            break
    if best is not None and best.log_odds >= RESOLVED:
        return proposal(best.excitation, separates, best.log_odds), ""
    apart = f"tell {effect_names(separates)} apart" if separates[1:] else f"show {separates[0]}"
    return None, (
        f"no trial with commands as in these logs, and at most {REACHES[-1]:g} times their travel, "
        f"would {apart}; larger commands, another load or another arm may"
    )


def _rivals(conclusions: Conclusions) -> tuple[list[Hypothesis], list[str]]:
    """Hypotheses that these logs do not tell apart, and the effects in question."""
    selection, last = conclusions.selection, conclusions.proposal.last
    base = conclusions.predictions.path[0]
    for at, (move, names) in enumerate(zip(last.moves, last.rivals, strict=False)):
        others, alike = [each.name for each in last.moves if each is not move], []
        for name in [n for n in names if TREND not in n and TRIAL not in n][:MOST_RIVALS]:
            if (made := selection.fitted.get(frozenset((*others, name)))) is None:
                made = selection.fitted.get(frozenset((*others[:at], name)))
                for later in last.moves[at + 1 :]:
                    made = made and tried(selection.trials, made, later)
            alike += [(name, made)] if made else []
        if move.candidate and alike:
            return [last, *(made for _, made in alike)], [move.name, *(name for name, _ in alike)]
    one = [h for h in selection.fitted.values() if len(h.moves) == 1 and h.moves[0].candidate]
    leads = [h.fit.value - base.fit.value - selection.price(h, base) for h in one]
    if not last.moves and max(leads, default=-np.inf) > -LIKE:
        nearest = one[int(np.argmax(leads))]
        return [last, nearest], [nearest.moves[0].name]
    return [], []


def _commands(conclusions: Conclusions) -> Iterator[tuple[str, Trial]]:
    """Commands from rest within the range of the logs, with their names."""
    selection, named = conclusions.selection, conclusions.named
    direct = direct_command(selection.trials.model) or "motor_voltage"
    name = direct if direct in named[0].trial.commands else "load_command"
    trials = [each.trial for each in named if name in each.trial.commands]
    unit, title = BY_QUANTITY[name].unit, name.replace("_", " ")
    values = np.concatenate([each.commands[name] for each in trials])
    rest = float(np.median([each.commands[name][0] for each in trials]))
    low, high = float(values.min()), float(values.max())
    usual = min(LONGEST_S, float(np.median([each.duration for each in trials])))
    step = selection.trials.span
    for size in SIZES:
        ends = [rest + size * (end - rest) for end in (low, high)]
        said = [figure(end / SI_FACTORS[unit]) for end in ends]
        between = f"between {said[0]} and {said[1]} {unit}"
        for period in [share * usual for share in PERIODS]:
            cycles = max(1.0, 0.5 * usual / period)
            turns = np.linspace(0.0, cycles, round(cycles * period / step) + 1)
            time = np.arange(0.0, len(turns)) * step
            for words, (places, levels) in CYCLES.items():
                shape = np.interp(turns % 1.0, places, levels)
                moved = rest + np.where(shape < 0.0, rest - ends[0], ends[1] - rest) * shape
                every = f"{words}, one in {figure(period, 2)} s"
                yield f"{title} {between}, {every}", Trial(time, {name: moved})
        for speed in SPEEDS:
            played = (trials[0].time - trials[0].time[0]) / speed
            time = np.arange(0.0, min(played[-1], 2.0 * LONGEST_S), step)
            moved = rest + size * (np.interp(time, played, trials[0].commands[name]) - rest)
            way = f"{1.0 / speed:g} times slower" if speed < 1.0 else f"{speed:g} times faster"
            words = f"{title} of {named[0].name} {way}, {between}"
            yield words, Trial(time, {name: moved})


@dataclass(frozen=True)
class Question:
    """Which of some rivals is right.

    Attributes:
        trials: so far.
        rivals: the likeliest first.
    """

    trials: PreparedTrials
    rivals: Sequence[Hypothesis]

    @cached_property
    def seen(self) -> tuple[float, float, float]:
        """Least, greatest and usual first reading of the first signal in the trials so far."""
        channel = self.trials.channels[0]
        rows = [each.measured[channel][each.counts[channel] > 0] for each in self.trials.logged]
        joined = np.concatenate(rows)
        return float(joined.min()), float(joined.max()), float(np.median([row[0] for row in rows]))

    def expected(self, name: str, trial: Trial) -> tuple[float, ExpectedOdds]:
        """How far a trial may go, in travels of the trials so far, and the log odds to expect."""
        low, high, start = self.seen
        signals, first = self.trials.model.rig.signals, self.trials.channels[0]
        still = {s.name: np.full(len(trial.time), 0.0) for s in signals}
        still[signals[first].name] += start
        logged = Logged.of(self.trials.model, 0, replace(trial, measurements=still))
        runs, predicted = [], []
        for rival in self.rivals:
            # Where a motion turns that nobody has seen is not known: all steps are divided.
            steps = rival.box.rows[0].steps * (TURNS if is_rugged(rival.box.model) else 1)
            rows = Rows(logged, self.trials.channels, steps, self.trials.linear, 1)
            box = GreyBox(rival.box.model, [rows], rival.box.channels, rival.box.threads)
            unread = counted(rows, np.zeros(len(rows.time), bool))
            ((errors, _),) = box.innovations([_alone(rival.fit.point)], [unread])
            runs.append(box)
            predicted.append(rows.readings[:, :, 0] - errors[0])
        way = np.array(predicted)[:, :, 0]
        column = BY_QUANTITY[signals[first].name]
        ends = [figure(end(way) / SI_FACTORS[column.unit], 2) for end in (np.min, np.max)]
        said = f"moves the {signal_name(column.name)} from {ends[0]} to {ends[1]} {column.unit}"
        far = (max(high, np.max(way)) - min(low, np.min(way))) / max(high - low, 1e-300)
        pairs = [pair for k in range(1, len(runs)) for pair in ((0, k), (k, 0))]
        odds = [self._log_odds(predicted[true], wrong, runs[wrong]) for true, wrong in pairs]
        return float(far), ExpectedOdds(Excitation(f"{name}; it {said}", trial, ()), min(odds))

    def _log_odds(self, readings: Array, wrong: int, box: GreyBox) -> float:
        """Log odds against a rival, its parameters refitted, by another one's readings."""
        made = self.rivals[wrong].fit
        point, read = _alone(made.point), copy(box.rows[0])
        read.readings = np.stack([readings, np.ones_like(readings)], axis=-1)
        own = [c for c in made.coordinates if c.name in point.numbers or c.name == "delay"]
        at = [made.coordinates.index(c) for c in own]
        beside = [
            with_values(point, with_tied({c.name: c.value(c.of(point) + STEP)}, made.tied))
            for c in own
        ]
        ((errors, spreads),) = box.innovations([point, *beside], [read])
        with np.errstate(all="ignore"):
            white = (errors / np.sqrt(spreads)).reshape(len(errors), -1)
        if not np.isfinite(white).all():
            return 0.0
        off, by = white[0], (white[1:] - white[0]) / STEP
        known = np.linalg.pinv(np.linalg.pinv(made.information)[np.ix_(at, at)])
        taken = np.linalg.pinv(by @ by.T + known)
        gain = off @ off - (by @ off) @ taken @ (by @ off)
        return 0.5 * max(float(gain), 0.0)


def _alone(point: Point) -> Point:
    """A fit's numbers for one trial more, with the usual latent force."""
    numbers = {n: v for n, v in point.numbers.items() if TREND not in n and TRIAL not in n}
    force = float(np.sqrt(np.mean(np.square(point.forces))))
    return replace(point, numbers=numbers, forces=(force,))
