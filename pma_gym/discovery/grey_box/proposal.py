"""The hypothesis that is proposed, and what it leaves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.candidate_effect import CandidateEffect
from pma_gym.discovery.grey_box.effect_selection import EffectSelection
from pma_gym.discovery.grey_box.first_fit import hold_fits
from pma_gym.discovery.grey_box.hypothesis import Hypothesis, Move
from pma_gym.discovery.grey_box.kept_fits import fit
from pma_gym.discovery.grey_box.predictions import Predictions
from pma_gym.discovery.grey_box.prepared_trials import CLOCK, FINAL, LEAST_FORCE
from pma_gym.discovery.grey_box.slots import gains_of_drive, quantity_of, slot
from pma_gym.discovery.grey_box.thresholds import FAR, LIKE, NOISES, SMALL
from pma_gym.discovery.result.misfit import rms
from pma_gym.discovery.thresholds import COMPLETE, CONFIDENCE, SURE
from pma_gym.estimation.innovations import Point
from pma_gym.estimation.likelihood_fit import Coordinate, value_of, with_tied, with_values

Array = NDArray[np.float64]

IDEAL = 0.01
"""Share of a fitted presliding distance at which friction lacks a tenth of what it lacks there."""


@dataclass(frozen=True)
class Proposal:
    """What is proposed of a selection's hypotheses, and how sure it is.

    Attributes:
        selection: of effects.
        predictions: by its hypotheses.
        candidates: the whole catalogue.
    """

    selection: EffectSelection
    predictions: Predictions
    candidates: Sequence[CandidateEffect]

    @cached_property
    def last(self) -> Hypothesis:
        """The hypothesis that is proposed, without what is not worth its price.

        That may be a delay, and the distance over which friction builds up before it slips.
        """
        now = self._chosen.fit
        chosen = self._precise(now.point, now.coordinates)
        slips = {c.name for c in now.coordinates if c.name.endswith(".presliding")}
        if slips:
            at = chosen.fit.point
            start = with_values(at, {name: IDEAL * value_of(at, name) for name in slips})
            ideal = self._precise(start, [c for c in now.coordinates if c.name not in slips])
            if ideal.fit.value > chosen.fit.value - chosen.price_of(len(slips)):
                chosen = ideal
        prompt = [c for c in chosen.fit.coordinates if c.name != "delay"]
        start = replace(chosen.fit.point, delay=0.0)
        made = fit(chosen.box, start, prompt, chosen.fit.tied, near=True)
        least = chosen.fit.value - chosen.price_of(1) - LIKE
        if made.value > least:
            chosen = replace(chosen, fit=made)
        return chosen

    def _precise(self, start: Point, coordinates: Sequence[Coordinate]) -> Hypothesis:
        """What is chosen, fitted once more from near its end with as many steps as it takes."""
        chosen, trials = self._chosen, self.selection.trials
        box = trials.precise(chosen.box.model, start, chosen.box.rows[0].steps, level=FINAL)
        made = fit(box, start, coordinates, chosen.fit.tied, near=True)
        return replace(chosen, box=box, fit=made)

    @cached_property
    def _chosen(self) -> Hypothesis:
        """The hypothesis that is proposed, with a delay.

        The last whose effects are surely of some size, and which predicts trials left out no worse.
        Where predictions miss widely all the same, it closes more than a small share of the gap:
        less than that is how approximate the others are.
        """
        best = self.predictions.path[0]
        for each in self.predictions.path[1:]:
            sized = all(_is_sized(each, move) for move in each.moves)
            first, before, after = (
                self.predictions.misfit(h) for h in (self.predictions.path[0], best, each)
            )
            if sized and after <= before * (1.0 + 1e-3):
                if after < NOISES or np.log(before / after) > SMALL * np.log(first / after):
                    best = each
        return best

    @cached_property
    def is_worse(self) -> bool:
        """Whether the model as it came predicts better than the proposed one."""
        pairs = zip(self.predictions.given, self.last.box.rows, strict=True)
        off = [((c - t.readings[:, :, 0]) / self.predictions.noise)[t.measured] for c, t in pairs]
        return rms(np.concatenate(off)) < self.predictions.misfit(self.last)

    def share(self, each: Hypothesis) -> float:
        """Latent force, in the mean over the horizon, root mean square over trials.

        As a share of the drive's.

        The mean of an Ornstein-Uhlenbeck force of memory m over a time h has the variance 2 m / h
        (1 - m / h (1 - e^(-h / m))) of its own: what changes fast moves nothing far.
        """
        ratio = each.fit.point.memory / self.predictions.horizon
        mean = 2.0 * ratio * (1.0 - ratio * (1.0 - np.exp(-1.0 / ratio)))
        return (
            float(np.sqrt(np.mean(np.square(each.fit.point.forces)) * mean))
            / self.selection.trials.force
        )

    @cached_property
    def left(self) -> float:
        """Share of the predictions' misfit beyond noise (mean square) that is left."""
        before, after = (
            max(self.predictions.misfit(each) ** 2 - 1.0, 1e-9)
            for each in (self.predictions.path[0], self.last)
        )
        return min(1.0, after / before)

    @cached_property
    def is_latent(self) -> bool:
        """Whether a latent force is worth its price beside the proposed hypothesis."""
        last = self.last
        without = [c for c in last.fit.coordinates if not c.name.startswith("force ")]
        none = replace(
            last.fit.point,
            forces=(LEAST_FORCE * self.selection.trials.force,) * len(self.selection.trials.logged),
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
        unknown = 0.0 if self.predictions.misfit(last) < COMPLETE else row
        # One shorter than a model may have is none.
        quantity = quantity_of("drive_delay.delay")
        if late < max(unknown, SURE * error, quantity.to_si(quantity.lower)):
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
            made = hold_fits(self.selection.trials, replace(last, fit=start), linear)
            values += [each.fit.value for each in made]
        return max(values)

    @property
    def delayed(self) -> bool:
        """Whether a delay of the command is named."""
        return self.delay_gain > LIKE

    @property
    def delays(self) -> tuple[float, float]:
        """Interval of a named delay (s).

        A held command is a line half a row later. Where the likelihood does not tell which it is,
        the interval holds the delays of both.
        """
        trials, last = self.selection.trials, self.last
        held, linear = (
            max(hold_fits(trials, last, kind), key=lambda each: each.fit.value).fit
            for kind in (False, True)
        )
        same, other = (linear, held) if trials.linear else (held, linear)
        alike = [last.fit, other] if other.value > same.value - LIKE else [last.fit]
        ends = [
            each.point.delay + side * each.deviations["delay"]
            for each in alike
            for side in (-CONFIDENCE, CONFIDENCE)
        ]
        return max(min(ends), 0.0), max(ends)

    @cached_property
    def far(self) -> dict[str, float]:
        """What moves the rig, or its inertia, far from the model's: fitted over given, by slot.

        What was fitted beside such a value stands in for something else, or the value is wrong.
        """
        own = self.predictions.path[0].box.numbers()
        names = [
            ".".join(self.selection.trials.model.rig.inertia),
            *gains_of_drive(self.selection.trials.model),
        ]
        free = {c.name for c in self.last.fit.coordinates}
        ratios = {n: value_of(self.last.fit.point, n) / own[n] for n in names if n in free}
        return {n: ratio for n, ratio in ratios.items() if not 1.0 / FAR < ratio < FAR}

    @cached_property
    def moved(self) -> bool:
        """Whether refitting the model's own parameters is worth its price."""
        base = self.predictions.path[0]
        own = base.box.numbers()
        free = [c for c in base.fit.coordinates if c.name not in own]
        values = with_tied(
            {c.name: own[c.name] for c in base.fit.coordinates if c.name in own}, base.fit.tied
        )
        made = fit(base.box, with_values(base.fit.point, values), free, base.fit.tied)
        return (
            base.fit.value - made.value > self.selection.price(base, replace(base, fit=made)) + LIKE
        )


def _is_sized(each: Hypothesis, move: Move) -> bool:
    """Whether some size of an added effect, or of a clock's error, is surely not none."""
    if move.candidate is None or move.is_free_law:
        # A deviation is never surely more than none: its price decides. So it does for a law that
        # is known up to a constant.
        sizes = [(n, abs(value_of(each.fit.point, n))) for n in move.slots if n == CLOCK.name]
        return all(size > SURE * each.fit.deviations[n] for n, size in sizes)
    made, candidate = each.fit, move.candidate
    for path, none, size in zip(
        candidate.paths, candidate.absent, candidate.amplitudes, strict=True
    ):
        if (name := slot(path)) in made.deviations and (size or not candidate.amplitudes.any()):
            absent = quantity_of(name).to_si(float(none))
            if abs(value_of(made.point, name) - absent) > SURE * made.deviations[name]:
                return True
    return False
