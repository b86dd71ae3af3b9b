"""What follows from a proposed hypothesis: verdict, amended model, curves and states of trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.data.trial_columns import BY_QUANTITY
from pma_gym.discovery.answer.trial_records import gaps
from pma_gym.discovery.diagnosis import Verdict
from pma_gym.discovery.grey_box.effect_selection import EffectSelection
from pma_gym.discovery.grey_box.hypothesis import Hypothesis
from pma_gym.discovery.grey_box.latent_law import fitted_law, latent_force, latent_line
from pma_gym.discovery.grey_box.predictions import Predictions
from pma_gym.discovery.grey_box.proposal import Proposal
from pma_gym.discovery.grey_box.sizes import estimate, named_effects
from pma_gym.discovery.grey_box.slots import path_of, quantity_of, slot, with_numbers
from pma_gym.discovery.grey_box.thresholds import MATERIAL, NOISES
from pma_gym.discovery.result.estimates import Moved, NamedEffect, TrialState
from pma_gym.discovery.result.misfit import Gap, ResidualLaw, TrialRecord, rms
from pma_gym.discovery.thresholds import COMPLETE, LEFT
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import TREND, TRIAL
from pma_gym.estimation.likelihood_fit import value_of
from pma_gym.estimation.smoother import Smoothed, smoothed
from pma_gym.plant.model import Model
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Conclusions:
    """All that follows from a selection of effects.

    Attributes:
        selection: of effects.
        predictions: by its hypotheses.
        proposal: the hypothesis that is proposed.
        named: the trials.
        tolerance: what the lab tolerates, by column in its unit.
    """

    selection: EffectSelection
    predictions: Predictions
    proposal: Proposal
    named: Sequence[NamedTrial]
    tolerance: Mapping[str, float]

    @cached_property
    def verdict(self) -> Verdict:
        """See `pma_gym.discovery.diagnosis.Verdict`."""
        proposal, last = self.proposal, self.proposal.last
        effects = proposal.delayed or any(move.candidate for move in last.moves)
        material = proposal.share(last) > MATERIAL and proposal.is_latent
        incomplete = material or proposal.is_latent and self.predictions.misfit(last) > COMPLETE
        # A law of free shape that trials left out do not confirm has refuted the others as well.
        if self.predictions.path[-1].free_law or material and not last.moves:
            return "unknown"
        if last.moves and proposal.left > LEFT and incomplete:
            return "unknown"
        if proposal.far:
            return "undecidable"
        if effects:
            return "effect"
        if not last.moves and self.predictions.misfit(last) > NOISES and proposal.is_latent:
            return "undecidable"
        alike = all(move.is_nuisance for move in last.moves)
        if self._within_tolerance() or alike and not proposal.moved:
            return "agrees"
        return "parameters"

    def _within_tolerance(self) -> bool:
        """Whether the model as it came is within what the lab tolerates.

        In all signals that it says one for.
        """
        known = {name: gap for name, gap in self.gap.items() if name in self.tolerance}
        return (
            bool(known)
            and not self.proposal.last.moves
            and all(g.before <= self.tolerance[n] for n, g in known.items())
        )

    @cached_property
    def effects(self) -> tuple[NamedEffect, ...]:
        """What is missing, with sizes."""
        return named_effects(self.proposal)

    @cached_property
    def parameters(self) -> dict[str, Moved]:
        """The model's own parameters by path."""
        own, out = self.predictions.path[0].box.numbers(), {}
        for coordinate in self.proposal.last.fit.coordinates:
            if coordinate.name in own and not coordinate.name.endswith(".presliding"):
                now = estimate(self.proposal.last.fit, coordinate.name)
                start = quantity_of(coordinate.name).from_si(own[coordinate.name])
                off = now.low is None or now.high is None or not now.low <= start <= now.high
                out[path_of(coordinate.name)] = Moved(start, now, off and self.verdict != "agrees")
        return out

    @property
    def written(self) -> Hypothesis:
        """Whose model is written: nothing is added to it where nothing carries enough."""
        none = self.verdict == "unknown" and not self.proposal.last.free_law
        return self.predictions.path[0] if none else self.proposal.last

    @cached_property
    def model(self) -> Model:
        """The amended model."""
        if self.verdict == "agrees" or self.proposal.is_worse or self.proposal.far:
            return self.selection.trials.model
        last, model = self.written, self.written.box.model
        if self.proposal.delayed and self.verdict == "effect":
            (late,) = [each for each in self.proposal.candidates if each.name == "drive_delay"]
            model = late.beside(model)
            milliseconds = (
                CATALOGUE["drive_delay"].quantities["delay"].from_si(last.fit.point.delay)
            )
            model = model.replace({"drive_delay.share": 1.0, "drive_delay.delay_ms": milliseconds})
        return with_numbers(model, last.fit.point.numbers)

    @cached_property
    def law(self) -> ResidualLaw | None:
        """What the latent force goes with."""
        base, free = self.predictions.path[0], self.selection.free_law
        if free is None or free.latent > LEFT * base.latent:
            return None
        return fitted_law(free, 1.0 - free.latent / base.latent, self.selection.trials.model.rig)

    @cached_property
    def line(self) -> tuple[float, float] | None:
        """Frequency (Hz) at which a force without a law oscillates, and the share of that."""
        return None if self.law else latent_line(self.smooth)

    @cached_property
    def records(self) -> tuple[TrialRecord, ...]:
        """Curves and gaps of every trial."""
        last, base = self.proposal.last, self.predictions.path[0]
        records = []
        signals = self.selection.trials.model.rig.signals
        ended = self._ended if last.moves else [None] * len(self.named)
        forces = map(partial(latent_force, self.selection.trials.model), self.smooth, ended)
        curves = zip(
            self.named,
            last.box.rows,
            forces,
            self.predictions.given,
            self.predictions.curves(base),
            self.predictions.curves(last),
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
                    rms(curve[there, i] - trial.readings[there, i, 0]) / SI_FACTORS[column.unit]
                    for curve in models
                )
                floor = last.fit.point.noises[i] / SI_FACTORS[column.unit]
                own[column.name] = Gap(
                    first, second, third, floor, self.predictions.holds_out(last)
                )
            columns = tuple(signal.column for signal in signals)
            held = self.predictions.holds_out(last)
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
    def states(self) -> dict[str, TrialState]:
        """What belongs to each trial: its start, and its own values."""
        last, out = self.proposal.last, {}
        position, speed = self.selection.trials.model.rig.start_paths.items()
        for i, (each, smooth) in enumerate(zip(self.named, self._ended, strict=True)):
            values = {}
            for (_, path), value in zip(
                (position, speed), (smooth.position[0], smooth.speed[0]), strict=True
            ):
                values[path] = float(value) / SI_FACTORS[quantity_of(slot(path)).unit]
            for move in last.moves:
                for name in () if move.is_nuisance else move.slots:
                    base, _, number = (
                        name.partition(TRIAL) if TRIAL in name else name.partition(TREND)
                    )
                    if TREND in name or int(number) == i:
                        own = value_of(last.fit.point, name)
                        own = (
                            value_of(last.fit.point, base) + own * last.box.order[i]
                            if TREND in name
                            else own
                        )
                        values[path_of(base)] = quantity_of(base).from_si(own)
            out[each.name] = TrialState({}, values)
        return out

    @cached_property
    def smooth(self) -> list[Smoothed]:
        """Latent force of each trial before anything was added."""
        base = self.predictions.path[0]
        return [smoothed(base.box, base.fit.point, i) for i in range(len(self.named))]

    @cached_property
    def _ended(self) -> list[Smoothed]:
        last = self.proposal.last
        return [smoothed(last.box, last.fit.point, i) for i in range(len(self.named))]
