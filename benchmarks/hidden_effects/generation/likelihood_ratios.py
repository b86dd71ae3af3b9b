"""Expected log-likelihood ratios of data, to first order about the true rig."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.hidden_effects.generation.effect_size import (
    ABSOLUTE,
    SHARE,
    Experiment,
    neighbours,
    simulate_variants,
)
from benchmarks.hidden_effects.generation.effects import Values
from benchmarks.hidden_effects.physics.rig import NOMINAL, Array

UNTOLD = 1.0
"""Log-likelihood ratio to expect, up to which data do not tell two truths apart: odds of e."""

SEEN = 12.5
"""The same, from which on an effect shows beyond doubt: five standard deviations."""

MOST_ODDS = 1e9
"""Largest log-likelihood ratio that is written down."""

KNOWN = 0.1
"""Standard deviation of what is known of base parameters before any trial, as a share."""

KNOWN_ABSOLUTE = {"drive_offset": 10.0, "regulator_offset": 5e3}
"""The same (SI) of those near 0."""


class Behind:
    """Deficit in log-likelihood of a refitted model without the hidden effect."""

    def __init__(
        self, experiment: Experiment, numbers: Values, base: Array, changed: Sequence[Array]
    ) -> None:
        """Take readings of the base, shape (trials, rows, 4), and of its `neighbours`."""
        self.experiment, self.base = experiment, base
        columns = [self._flat(readings) for readings in changed]
        for trial in range(len(base)):
            for signal in (0, 1):
                constant = base.copy()
                constant[trial, :, signal] += self.experiment.noise[signal]
                columns.append(self._flat(constant))
        self.columns = np.stack(columns, axis=1)
        weights = [_steps_known(name, float(numbers[name])) for name in numbers]
        weights += [0.0] * (len(columns) - len(weights))
        self.prior = np.diag(weights)

    def log_odds(self, truth: Array, rival: Array | None = None) -> float:
        """Half the chi-square that the base, and a rival of free size, cannot absorb of a truth.

        Args:
            truth: readings with what is hidden, shape (trials, rows, 4).
            rival: readings with the rival at some size; none but the base if not given.
        Returns:
            Infinite where a rig runs away: nothing else does that.
        """
        if not np.isfinite(truth).all() or (rival is not None and not np.isfinite(rival).all()):
            return float("inf")
        change, columns, prior = self._flat(truth), self.columns, self.prior
        if rival is not None:
            columns = np.column_stack([columns, self._flat(rival)])
            prior = np.pad(prior, (0, 1))
        matrix = np.vstack([columns, prior])
        scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-12)
        target = np.concatenate([change, np.zeros(len(prior))])
        moves = np.linalg.lstsq(matrix / scale, target, rcond=1e-9)[0]
        return 0.5 * float(np.sum((target - matrix / scale @ moves) ** 2))

    def _flat(self, readings: Array) -> Array:
        """Change of the measured readings, over the noise."""
        change = (readings - self.base) / self.experiment.noise
        return change[self.experiment.measured].ravel()


def _steps_known(name: str, value: float) -> float:
    """One over what is known of a parameter beforehand, in steps of `neighbours`."""
    step = ABSOLUTE.get(name, SHARE * abs(value))
    return step / KNOWN_ABSOLUTE.get(name, KNOWN * abs(value))


def odds_of_parameters(
    experiment: Experiment,
    numbers: Values,
    factors: Mapping[str, float],
    together: Sequence[Sequence[str]],
) -> dict[str, float]:
    """Log-likelihood ratio to expect of each group of parameters that is off, by its first name.

    Of the true rig against one whose parameters of the group are what the lab believes, and whose
    others were refitted.

    Args:
        experiment: the commands.
        numbers: the true base parameters.
        factors: by which some are off.
        together: groups that are off by one factor.
    """
    off = [names for names in together if names[0] in factors]
    believed = [{**numbers, **{name: NOMINAL[name] for name in names}} for names in off]
    near = neighbours(numbers)
    rigs = [numbers, *near, *believed]
    base, *readings = simulate_variants(experiment.commands, [(rig, {}) for rig in rigs])
    moved = dict(zip(numbers, readings[: len(near)], strict=True))
    odds = {}
    for names, put_back in zip(off, readings[len(near) :], strict=True):
        others = {name: numbers[name] for name in numbers if name not in names}
        behind = Behind(experiment, others, base, [moved[name] for name in others])
        # A rig that runs away is told for certain, and a file has no infinities.
        odds[names[0]] = round(min(behind.log_odds(put_back), MOST_ODDS), 4)
    return odds
