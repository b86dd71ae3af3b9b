"""Predictions of trials, of those left out by fits that have not seen them, and what they miss."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from math import hypot

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.grey_box.hypothesis import Hypothesis
from pma_gym.discovery.grey_box.kept_fits import fit
from pma_gym.discovery.grey_box.prepared_trials import PreparedTrials
from pma_gym.discovery.grey_box.thresholds import HORIZON, HORIZON_S
from pma_gym.discovery.result.misfit import rms
from pma_gym.estimation.innovations import TRIAL, GreyBox, predictions
from pma_gym.estimation.likelihood_fit import value_of, with_tied, with_values

Array = NDArray[np.float64]

FOLDS = 3
"""Parts of the trials, or stretches of a single one, that are left out in turn."""


@dataclass(frozen=True)
class Predictions:
    """Predictions by the hypotheses of a selection.

    Attributes:
        trials: that are predicted.
        path: hypotheses, the model as it came first.
        tell: called with what is being done, what is done of it and its total.
    """

    trials: PreparedTrials
    path: Sequence[Hypothesis]
    tell: Callable[[str, int, int], None]

    @cached_property
    def horizon(self) -> float:
        """How far ahead is predicted (s)."""
        shortest = min(float(each.time[-1] - each.time[0]) for each in self.trials.logged)
        return min(HORIZON_S, HORIZON * shortest)

    def curves(self, each: Hypothesis) -> list[Array]:
        """Predictions of all trials, of what is left out by fits that had not seen it."""
        if id(each) not in self._curves:
            self._curves[id(each)] = (
                self._left_out(each)
                if self.holds_out(each)
                else predictions(each.box, each.fit.point, self.horizon)
            )
        return self._curves[id(each)]

    @cached_property
    def _curves(self) -> dict[int, list[Array]]:
        return {}

    def holds_out(self, each: Hypothesis) -> bool:
        """Whether trials, or stretches of a single one, can be left out.

        A parameter of one trial alone cannot be estimated from the others.
        """
        return not any(TRIAL in move.name for move in each.moves)

    def _left_out(self, each: Hypothesis) -> list[Array]:
        parts, alone = self._parts(each.box), len(self.trials.logged) == 1
        out = [np.full(trial.readings.shape[:2], np.nan) for trial in each.box.rows]
        for fold in range(1 + max(int(part.max()) for part in parts)):
            done, total = FOLDS * len(self._curves) + fold, FOLDS * (len(self.path) + 1)
            self.tell("trials left out", done, total)
            rows = [copy(trial) for trial in each.box.rows]
            for trial, part in zip(rows, parts, strict=True):
                trial.there = trial.there & (part != fold)[:, None]
            box = GreyBox(each.box.model, rows, each.box.channels, each.box.threads)
            made = fit(box, each.fit.point, each.fit.coordinates, each.fit.tied, near=True)
            left = [i for i, part in enumerate(parts) if not alone and part[0] == fold]
            forces = {f"force {i}": value_of(each.fit.point, f"force {i}") for i in left}
            curves = predictions(each.box, with_values(made.point, forces), self.horizon)
            for i, (curve, part) in enumerate(zip(curves, parts, strict=True)):
                out[i] = np.where((part == fold)[:, None], curve, out[i])
        return out

    def _parts(self, box: GreyBox) -> list[NDArray[np.int64]]:
        """In which part each row is left out, by trial: its trial's, or its stretch of one."""
        if len(box.rows) == 1:
            rows = len(box.rows[0].time)
            return [np.arange(rows) * FOLDS // rows]
        return [np.full(len(trial.time), i % FOLDS) for i, trial in enumerate(box.rows)]

    @cached_property
    def noise(self) -> list[float]:
        """Noise of each read signal that misses are counted in, with that which has a colour."""
        first, *others = self.trials.noise
        return [hypot(first, self.path[-1].fit.point.colour), *others]

    def misfit(self, each: Hypothesis) -> float:
        """Root mean square of what predictions miss, in noises."""
        parts = [
            ((curve - trial.readings[:, :, 0]) / self.noise)[trial.measured]
            for curve, trial in zip(self.curves(each), each.box.rows, strict=True)
        ]
        return rms(np.concatenate(parts))

    @cached_property
    def given(self) -> list[Array]:
        """Predictions of the model as it came, with the noise and latent force of its fit."""
        base = self.path[0]
        own = base.box.numbers()
        values = {c.name: own[c.name] for c in base.fit.coordinates if c.name in own}
        late = {"delay": 0.0}
        point = with_values(base.fit.point, with_tied({**values, **late}, base.fit.tied))
        return predictions(base.box, point, self.horizon)
