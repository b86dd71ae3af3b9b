"""What a selection of effects leads to, and what follows from it.

Verdict, sizes with intervals, gaps of predictions, the amended model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.answer.trial_records import gaps
from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.effect_selection import EffectSelection
from pma_gym.discovery.grey_box.first_fit import hold_fits
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move
from pma_gym.discovery.grey_box.kept_fits import fit
from pma_gym.discovery.grey_box.latent_law import latent_force, latent_law, latent_line
from pma_gym.discovery.grey_box.prepared_trials import LEAST_FORCE
from pma_gym.discovery.grey_box.slots import (
    gains_of_drive,
    path_of,
    quantity_of,
    slot,
    with_numbers,
)
from pma_gym.discovery.grey_box.thresholds import (
    COMPLETE,
    CONFIDENCE,
    FAR,
    HORIZON,
    HORIZON_S,
    LEFT,
    LIKE,
    MATERIAL,
    NOISES,
    ROWS_LATE,
    SMALL,
    SURE,
)
from pma_gym.discovery.result.estimates import Estimate, Moved, NamedEffect, TrialState
from pma_gym.discovery.result.misfit import Gap, ResidualLaw, TrialRecord
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import TREND, TRIAL, GreyBox, counted, predictions
from pma_gym.estimation.likelihood_fit import value_of, with_tied, with_values
from pma_gym.estimation.smoother import Smoothed, smoothed
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

FOLDS = 3
"""Parts of the trials that are left out in turn."""


@dataclass(frozen=True)
class Conclusions:
    """All that follows from a selection of effects.

    Attributes:
        selection: of effects.
        path: its hypotheses, the model as it came first.
        named: the trials.
        tolerance: what the lab tolerates, by column in its unit.
        candidates: the whole catalogue.
    """

    selection: EffectSelection
    path: Sequence[Hypothesis]
    named: Sequence[NamedTrial]
    tolerance: Mapping[str, float]
    candidates: Sequence[CandidateEffect]

    @cached_property
    def horizon(self) -> float:
        """How far ahead is predicted (s)."""
        shortest = min(float(each.time[-1] - each.time[0]) for each in self.selection.trials.logged)
        return min(HORIZON_S, HORIZON * shortest)

    @cached_property
    def last(self) -> Hypothesis:
        """The hypothesis that is proposed, without a delay that is not worth its price."""
        chosen = self._chosen
        prompt = [c for c in chosen.fit.coordinates if c.name != "delay"]
        made = fit(chosen.box, replace(chosen.fit.point, delay=0.0), prompt, chosen.fit.tied)
        least = chosen.fit.value - chosen.price_of(1) - LIKE
        return replace(chosen, fit=made) if made.value > least else chosen

    @cached_property
    def _chosen(self) -> Hypothesis:
        """The hypothesis that is proposed, with a delay.

        The last whose effects are surely of some size, and which predicts trials left out no worse.
        Where predictions miss widely all the same, it closes more than a small share of the gap:
        less than that is how approximate the others are.
        """
        best = self.path[0]
        for each in self.path[1:]:
            sized = all(self._is_sized(each, move) for move in each.moves)
            first, before, after = (self.misfit(h) for h in (self.path[0], best, each))
            if sized and after <= before * (1.0 + 1e-3):
                if after < NOISES or np.log(before / after) > SMALL * np.log(first / after):
                    best = each
        return best

    def curves(self, each: Hypothesis) -> list[Array]:
        """Predictions of all trials, those left out by fits that had not seen them."""
        if id(each) not in self._curves:
            self._curves[id(each)] = (
                self._left_out(each) if self.holds_out(each) else self._seen(each)
            )
        return self._curves[id(each)]

    @cached_property
    def _curves(self) -> dict[int, list[Array]]:
        return {}

    def holds_out(self, each: Hypothesis) -> bool:
        """Whether trials can be left out.

        A parameter of one trial alone cannot be told by the others.
        """
        return len(self.named) > 1 and not any(TRIAL in move.name for move in each.moves)

    def _seen(self, each: Hypothesis) -> list[Array]:
        return predictions(each.box, each.fit.point, self.horizon)

    def _left_out(self, each: Hypothesis) -> list[Array]:
        count = len(self.named)
        out: list[Array] = [np.empty(0)] * count
        for fold in range(min(FOLDS, count)):
            done, total = FOLDS * len(self._curves) + fold, FOLDS * (len(self.path) + 1)
            self.selection.tell("trials left out", done, total)
            left = [i for i in range(count) if i % FOLDS == fold]
            rows = [
                counted(trial, np.full(len(trial.time), i not in left))
                for i, trial in enumerate(each.box.rows)
            ]
            for i in left:
                rows[i].there = np.zeros_like(rows[i].there)
            box = GreyBox(each.box.model, rows, each.box.channels, each.box.threads)
            made = fit(box, each.fit.point, each.fit.coordinates, each.fit.tied)
            forces = {f"force {i}": value_of(each.fit.point, f"force {i}") for i in left}
            curves = predictions(each.box, with_values(made.point, forces), self.horizon)
            for i in left:
                out[i] = curves[i]
        return out

    def misfit(self, each: Hypothesis) -> float:
        """Root mean square of what predictions miss, in noises."""
        parts = [
            ((curve - trial.readings[:, :, 0]) / self.selection.trials.noise)[trial.measured]
            for curve, trial in zip(self.curves(each), each.box.rows, strict=True)
        ]
        return _rms(np.concatenate(parts))

    @cached_property
    def given(self) -> list[Array]:
        """Predictions of the model as it came, with the noise and latent force of its fit."""
        base = self.path[0]
        own = base.box.numbers()
        values = {c.name: own[c.name] for c in base.fit.coordinates if c.name in own}
        late = {"delay": 0.0}
        point = with_values(base.fit.point, with_tied({**values, **late}, base.fit.tied))
        return predictions(base.box, point, self.horizon)

    @cached_property
    def is_worse(self) -> bool:
        """Whether the model as it came predicts better than the proposed one."""
        pairs = zip(self.given, self.last.box.rows, strict=True)
        off = [
            ((c - t.readings[:, :, 0]) / self.selection.trials.noise)[t.measured] for c, t in pairs
        ]
        return _rms(np.concatenate(off)) < self.misfit(self.last)

    def share(self, each: Hypothesis) -> float:
        """Latent force, in the mean over the horizon, root mean square over trials.

        As a share of the drive's.

        The mean of an Ornstein-Uhlenbeck force of memory m over a time h has the variance 2 m / h
        (1 - m / h (1 - e^(-h / m))) of its own: what changes fast moves nothing far.
        """
        ratio = each.fit.point.memory / self.horizon
        mean = 2.0 * ratio * (1.0 - ratio * (1.0 - np.exp(-1.0 / ratio)))
        return (
            float(np.sqrt(np.mean(np.square(each.fit.point.forces)) * mean))
            / self.selection.trials.force
        )

    @cached_property
    def left(self) -> float:
        """Share of the predictions' misfit beyond noise (mean square) that is left."""
        before, after = (
            max(self.misfit(each) ** 2 - 1.0, 1e-9) for each in (self.path[0], self.last)
        )
        return min(1.0, after / before)

    @cached_property
    def is_latent(self) -> bool:
        """Whether a latent force is worth its price beside the proposed hypothesis."""
        last = self.last
        without = [c for c in last.fit.coordinates if not c.name.startswith("force ")]
        none = replace(
            last.fit.point, forces=(LEAST_FORCE * self.selection.trials.force,) * len(self.named)
        )
        made = fit(last.box, none, without, last.fit.tied)
        return (
            last.fit.value - made.value > self.selection.price(last, replace(last, fit=made)) + LIKE
        )

    @cached_property
    def delay_gain(self) -> float:
        """Log likelihood that a delay gains beyond its price; 0 for a jitter of the clock."""
        last = self.last
        if not self.candidates or not any(c.name == "delay" for c in last.fit.coordinates):
            return 0.0
        late, error = last.fit.point.delay, last.fit.deviations["delay"]
        row = (
            self.selection.trials.span / self.selection.trials.stride / self.selection.trials.block
        )
        # How an incomplete model's commands run between rows is not known to less than a row.
        rows = ROWS_LATE if self.misfit(last) < COMPLETE else 1.0
        if late < max(rows * row, CONFIDENCE * error):
            return 0.0
        price = np.log(len(self.candidates)) + last.price_of(1)
        return max(0.0, last.fit.value - self._prompt - float(price))

    @property
    def _prompt(self) -> float:
        """Log likelihood without a delay, with commands held or linear between rows."""
        last, values = self.last, []
        prompt = tuple(c for c in last.fit.coordinates if c.name != "delay")
        start = replace(last.fit, point=replace(last.fit.point, delay=0.0), coordinates=prompt)
        for linear in (False, True):
            made = hold_fits(
                self.selection.trials, start, last.box.model, linear, last.box.rows[0].steps
            )
            values += [each.value for each in made]
        return max(values)

    @property
    def delayed(self) -> bool:
        """Whether a delay of the command is named."""
        return self.delay_gain > LIKE

    @cached_property
    def verdict(self) -> Verdict:
        """See `pma_gym.discovery.diagnosis.Verdict`."""
        effects = self.delayed or any(move.candidate for move in self.last.moves)
        material = self.share(self.last) > MATERIAL and self.is_latent
        if not self.last.moves and len(self.path) > 1 and self.is_latent:
            return "unknown"
        incomplete = material or self.is_latent and self.misfit(self.last) > COMPLETE
        if material and not self.last.moves:
            return "unknown"
        if self.last.moves and self.left > LEFT and incomplete:
            return "unknown"
        if self.far:
            return "undecidable"
        if effects:
            return "effect"
        if not self.last.moves and self.misfit(self.last) > NOISES and self.is_latent:
            return "undecidable"
        if self._within_tolerance() or not self.last.moves and not self._moved:
            return "agrees"
        return "parameters"

    @cached_property
    def far(self) -> dict[str, float]:
        """What moves the rig, or its inertia, far from the model's: fitted over given, by slot.

        What was fitted beside such a value stands in for something else, or the value is wrong.
        """
        own = self.path[0].box.numbers()
        names = [
            ".".join(self.selection.trials.model.rig.inertia),
            *gains_of_drive(self.selection.trials.model),
        ]
        free = {c.name for c in self.last.fit.coordinates}
        ratios = {n: value_of(self.last.fit.point, n) / own[n] for n in names if n in free}
        return {n: ratio for n, ratio in ratios.items() if not 1.0 / FAR < ratio < FAR}

    def _is_sized(self, each: Hypothesis, move: Move) -> bool:
        """Whether some size of an added effect is surely not none."""
        if move.candidate is None:
            return True
        made, candidate = each.fit, move.candidate
        for path, none, size in zip(
            candidate.paths, candidate.absent, candidate.amplitudes, strict=True
        ):
            if (name := slot(path)) in made.deviations and (size or not candidate.amplitudes.any()):
                absent = quantity_of(name).to_si(float(none))
                if abs(value_of(made.point, name) - absent) > SURE * made.deviations[name]:
                    return True
        return False

    def _within_tolerance(self) -> bool:
        """Whether the model as it came is within what the lab tolerates.

        In all signals that it says one for.
        """
        known = {name: gap for name, gap in self.gap.items() if name in self.tolerance}
        return (
            bool(known)
            and not self.last.moves
            and all(g.before <= self.tolerance[n] for n, g in known.items())
        )

    @cached_property
    def _moved(self) -> bool:
        """Whether refitting the model's own parameters is worth its price."""
        base = self.path[0]
        own = base.box.numbers()
        free = [c for c in base.fit.coordinates if c.name not in own]
        values = with_tied(
            {c.name: own[c.name] for c in base.fit.coordinates if c.name in own}, base.fit.tied
        )
        made = fit(base.box, with_values(base.fit.point, values), free, base.fit.tied)
        return (
            base.fit.value - made.value > self.selection.price(base, replace(base, fit=made)) + LIKE
        )

    @cached_property
    def records(self) -> tuple[TrialRecord, ...]:
        """Curves and gaps of every trial."""
        last, base = self.last, self.path[0]
        records = []
        signals = self.selection.trials.model.rig.signals
        ended = self._ended if last.moves else [None] * len(self.named)
        forces = map(partial(latent_force, self.selection.trials.model), self.smooth, ended)
        curves = zip(
            self.named,
            last.box.rows,
            forces,
            self.given,
            self.curves(base),
            self.curves(last),
            strict=True,
        )
        for each, trial, force, *models in curves:
            shape = (len(trial.time), len(signals))
            measured, before, refitted, after = (np.full(shape, np.nan) for _ in range(4))
            own = {}
            for i, channel in enumerate(last.box.channels):
                there = trial.measured[:, i]
                measured[there, channel] = trial.readings[there, i, 0]
                for room, curve in zip((before, refitted, after), models, strict=True):
                    room[:, channel] = curve[:, i]
                column = BY_QUANTITY[signals[channel].name]
                first, second, third = (
                    _rms(curve[there, i] - trial.readings[there, i, 0]) / SI_FACTORS[column.unit]
                    for curve in models
                )
                floor = last.fit.point.deviations[i] / SI_FACTORS[column.unit]
                own[column.name] = Gap(first, second, third, floor, self.holds_out(last))
            columns = tuple(signal.column for signal in signals)
            held = self.holds_out(last)
            records.append(
                TrialRecord(
                    each.name,
                    trial.time,
                    measured,
                    before,
                    refitted,
                    after,
                    own,
                    held,
                    each.file or each.name,
                    columns,
                    force,
                )
            )
        return tuple(records)

    @cached_property
    def gap(self) -> dict[str, Gap]:
        """Gaps over all trials, by column."""
        return gaps(self.records)

    @cached_property
    def model(self) -> Model:
        """The amended model."""
        if self.verdict == "agrees" or self.is_worse or self.far:
            return self.selection.trials.model
        last = self.path[0] if self.verdict == "unknown" else self.last
        model = last.box.model
        if self.delayed and self.verdict == "effect":
            (late,) = [each for each in self.candidates if each.name == "drive_delay"]
            model = late.beside(model)
            milliseconds = (
                CATALOGUE["drive_delay"].quantities["delay"].from_si(last.fit.point.delay)
            )
            model = model.replace({"drive_delay.share": 1.0, "drive_delay.delay_ms": milliseconds})
        return with_numbers(model, last.fit.point.numbers)

    def estimate(self, name: str) -> Estimate:
        """A fitted number with its interval, in its file unit."""
        made, base = self.last.fit, name.partition(TREND)[0].partition(TRIAL)[0]
        quantity = quantity_of(base)
        value, error = value_of(made.point, name), CONFIDENCE * made.deviations[name]
        zero = quantity.to_si(0.0) if TREND in name else 0.0
        low, value_, high = (
            quantity.from_si(v + zero) for v in (value - error, value, value + error)
        )
        if TREND not in name:
            low, high = max(low, quantity.lower), min(high, quantity.upper)
        coordinate = next(c for c in made.coordinates if c.name == name)
        ends = {coordinate.lower: "lower", coordinate.upper: "upper"}
        return Estimate(value_, low, high, quantity.unit, ends.get(value, ""))

    @cached_property
    def effects(self) -> tuple[NamedEffect, ...]:
        """What is missing, with sizes.

        Also the candidate that does most where nothing carries enough.
        """
        made = []
        rivals = [*self.last.rivals, *[()] * len(self.last.moves)]
        for move, others in zip(self.last.moves, rivals, strict=False):
            if move.candidate is not None:
                own = {c.name for c in self.path[0].fit.coordinates}
                names = [
                    c.name
                    for c in self.last.fit.coordinates
                    if c.name.startswith(f"{move.candidate.effect}.")
                ]
                names = [n for n in names if n not in own and TRIAL not in n and TREND not in n]
                sizes = {path_of(n).partition(".")[2]: self.estimate(n) for n in names}
                tied = {n: of for n, of in self.last.fit.tied.items() if of in names}
                sizes |= {
                    path_of(n).partition(".")[2]: self.estimate(of)
                    for n, of in tied.items()
                    if TRIAL not in n and TREND not in n
                }
                alike = tuple(
                    other for other in others if TREND not in other and TRIAL not in other
                )
                made.append(NamedEffect(move.candidate.name, alike, self._chance(move), sizes))
        if self.delayed:
            late, error = (
                1e3 * v
                for v in (self.last.fit.point.delay, CONFIDENCE * self.last.fit.deviations["delay"])
            )
            made.append(
                NamedEffect(
                    "drive_delay",
                    self._late,
                    float(np.exp(-min(self.delay_gain, 600.0))),
                    {"delay_ms": Estimate(late, max(late - error, 0.0), late + error, "ms")},
                )
            )
        return tuple(made)

    @property
    def _late(self) -> tuple[str, ...]:
        """What comes to the same as a delay of the command.

        A lag, and with one signal that of its sensor.
        """
        channels = self.last.box.channels
        sensors = [self.selection.trials.model.rig.signals[channel].sensor for channel in channels]
        late = [f"{sensor}_{kind}" for sensor in sensors for kind in ("delay", "lag")]
        names = [each.name for each in self.candidates]
        return tuple(n for n in names if n == "drive_lag" or len(channels) == 1 and n in late)

    def _chance(self, move: Move) -> float:
        """Bound of the chance of such a gain over all that was looked for."""
        gain = self.selection.gains.get(move.name, 0.0)
        return float(min(1.0, len(self.candidates) * np.exp(-np.clip(gain, 0.0, 600.0))))

    @cached_property
    def parameters(self) -> dict[str, Moved]:
        """The model's own parameters by path."""
        own, out = self.path[0].box.numbers(), {}
        for coordinate in self.last.fit.coordinates:
            if coordinate.name in own and not coordinate.name.endswith(".presliding"):
                now = self.estimate(coordinate.name)
                start = quantity_of(coordinate.name).from_si(own[coordinate.name])
                off = now.low is None or now.high is None or not now.low <= start <= now.high
                out[path_of(coordinate.name)] = Moved(start, now, off and self.verdict != "agrees")
        return out

    @cached_property
    def smooth(self) -> list[Smoothed]:
        """Latent force of each trial before anything was added."""
        base = self.path[0]
        return [smoothed(base.box, base.fit.point, i) for i in range(len(self.named))]

    @cached_property
    def law(self) -> ResidualLaw | None:
        """What the latent force goes with."""
        base = self.path[0]
        rows = max(1.0, 2.0 * base.fit.point.memory / self.selection.trials.span)
        return latent_law(self.smooth, self.selection.trials.model.rig, rows)

    @cached_property
    def line(self) -> tuple[float, float] | None:
        """Frequency (Hz) at which a force without a law oscillates, and the share of that."""
        return None if self.law else latent_line(self.smooth)

    @cached_property
    def states(self) -> dict[str, TrialState]:
        """What belongs to each trial: its start, and its own values."""
        out = {}
        position, speed = self.selection.trials.model.rig.start_paths.items()
        for i, (each, smooth) in enumerate(zip(self.named, self._ended, strict=True)):
            values = {}
            for (_, path), value in zip(
                (position, speed), (smooth.position[0], smooth.speed[0]), strict=True
            ):
                values[path] = float(value) / SI_FACTORS[quantity_of(slot(path)).unit]
            for move in self.last.moves:
                for name in move.slots:
                    base, _, number = (
                        name.partition(TRIAL) if TRIAL in name else name.partition(TREND)
                    )
                    if TREND in name or int(number) == i:
                        own = value_of(self.last.fit.point, name)
                        own = (
                            value_of(self.last.fit.point, base) + own * self.last.box.order[i]
                            if TREND in name
                            else own
                        )
                        values[path_of(base)] = quantity_of(base).from_si(own)
            out[each.name] = TrialState({}, values)
        return out

    @cached_property
    def _ended(self) -> list[Smoothed]:
        return [smoothed(self.last.box, self.last.fit.point, i) for i in range(len(self.named))]


def _rms(off: Array) -> float:
    return float(np.sqrt(np.nanmean(off**2)))
