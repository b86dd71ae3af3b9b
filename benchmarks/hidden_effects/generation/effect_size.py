"""Size r of an effect in data: its change beyond a refit of the base model, over noise.

The refit is linear: sensitivities to the base parameters by differences of our own simulator, and a
constant a trial for contraction and for rotation. r is the rms over all rows of the signal with the
largest ratio.

Log-likelihood ratios are those expected of data, to first order about the true rig.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.hidden_effects.generation.effects import ALL, Values
from benchmarks.hidden_effects.physics.rig import NOMINAL, SIGNALS, Array
from benchmarks.hidden_effects.physics.simulation import Commands, simulate

ABSOLUTE = {"drive_offset": 2.0, "regulator_offset": 2e3}
"""Steps (SI) of differences for parameters near 0; the others go by a share."""

SHARE = 0.005

Lane = tuple[Mapping[str, float], Mapping[str, Values]]
"""A rig's parameters, and parameters of the effects at work by name."""


@dataclass(frozen=True)
class Experiment:
    """Commands of a data set.

    Attributes:
        commands: of every trial, shape (trials, rows).
        measured: which rows belong to their trial, shape (trials, rows).
        noise: standard deviations (SI), shape (4,).
    """

    commands: Commands
    measured: NDArray[np.bool_]
    noise: Array


def simulate_variants(commands: Commands, variants: Sequence[Lane]) -> Array:
    """Readings of all trials by several rigs at once, shape (variants, trials, rows, 4) (SI).

    Rigs without an effect that others have take it at size 0.
    """
    trials, count = len(commands.order), len(variants)
    wide = Commands(
        np.tile(commands.motor, (count, 1)),
        np.tile(commands.regulator, (count, 1)),
        np.tile(commands.order, count),
    )
    rig = {
        name: np.repeat([float(numbers[name]) for numbers, _ in variants], trials)
        for name in NOMINAL
    }
    hidden = []
    for name in dict.fromkeys(name for _, effects in variants for name in effects):
        some = next(effects[name] for _, effects in variants if name in effects)
        absent = ALL[name].at(some, 0.0)
        rows = [effects.get(name, absent) for _, effects in variants]
        columns = {key: np.repeat([float(row[key]) for row in rows], trials) for key in some}
        hidden.append(ALL[name].build(columns))
    # Of effects that are tried far too large some rigs run away; who asks for readings looks.
    with np.errstate(over="ignore", invalid="ignore"):
        readings = simulate(wide, rig, hidden)
    for effect in hidden:
        readings = effect.shown(readings)
    return readings.reshape(count, trials, *readings.shape[1:])


def neighbours(rig: Mapping[str, float]) -> list[dict[str, float]]:
    """Rigs of which one parameter each is a little larger."""
    steps = {name: ABSOLUTE.get(name, SHARE * value) for name, value in rig.items()}
    return [{**rig, name: rig[name] + steps[name]} for name in rig]


class Ruler:
    """Measures what is left of a change once the base model was refitted."""

    def __init__(self, experiment: Experiment, base: Array, perturbed: Array) -> None:
        """Take readings of the base, shape (trials, rows, 4), and of its neighbours."""
        self.experiment, self.base = experiment, base
        columns = [self._flat(readings - base) for readings in perturbed]
        for trial in range(len(base)):
            for signal in (0, 1):
                constant = np.zeros_like(base)
                constant[trial, :, signal] = 1.0
                columns.append(self._flat(constant))
        matrix = np.stack(columns, axis=1)
        matrix /= np.maximum(np.linalg.norm(matrix, axis=0), 1e-12)
        left, strength, _ = np.linalg.svd(matrix, full_matrices=False)
        self.space = left[:, strength > 1e-6 * strength[0]]

    def ratios(self, readings: Array) -> Array:
        """Rms of the rest over the noise, by signal, shape (4,)."""
        change = self._flat(readings - self.base)
        change -= self.space @ (self.space.T @ change)
        return np.sqrt(np.mean(change.reshape(-1, 4) ** 2, axis=0))

    def size(self, readings: Array) -> float:
        """The largest of `ratios`."""
        return float(self.ratios(readings).max())

    def _flat(self, change: Array) -> Array:
        return (change / self.experiment.noise)[self.experiment.measured].ravel()


def describe(ratios: Array) -> dict[str, float]:
    """Ratios by signal, rounded."""
    return {name: round(float(r), 4) for name, r in zip(SIGNALS, ratios, strict=True)}


def scale_to(
    ruler: Ruler,
    experiment: Experiment,
    rig: Mapping[str, float],
    name: str,
    typical: Values,
    target: float,
    known: Mapping[float, float],
) -> tuple[float, Array]:
    """Size at which an effect has a ratio of `target`, and its readings there.

    Args:
        ruler: measures the ratio.
        experiment: the commands.
        rig: true base parameters.
        name: of the effect.
        typical: its parameters at size 1.
        target: ratio wanted.
        known: ratios at some sizes.
    """
    kind, ratios = ALL[name], dict(known)
    readings = ruler.base
    size = 1.0
    for _ in range(8):
        size = _interpolated(ratios, target, kind.most) if kind.sized else 1.0
        lane = (rig, {name: kind.at(typical, size)})
        readings = simulate_variants(experiment.commands, [lane])[0]
        ratios[size] = ruler.size(readings)
        near = abs(np.log(max(ratios[size], 1e-9) / target)) < 0.05
        if near or size >= kind.most or not kind.sized:
            break
    return size, readings


def _interpolated(known: Mapping[float, float], target: float, most: float) -> float:
    """Where a ratio crosses the target, linear in the logarithms; a line beyond what is known."""
    sizes = np.array(sorted(known))
    ratios = np.maximum.accumulate([max(known[size], 0.02 * target) for size in sizes])
    above = np.flatnonzero(ratios >= target)
    if above.size == 0:
        return (
            most if sizes[-1] >= 0.99 * most else min(most, float(sizes[-1] * target / ratios[-1]))
        )
    k = int(above[0])
    if k == 0:
        return float(sizes[0] * target / ratios[0])
    (low, high), (less, more) = np.log(sizes[k - 1 : k + 1]), np.log(ratios[k - 1 : k + 1])
    share = (np.log(target) - less) / max(more - less, 1e-9)
    return float(np.exp(low + share * (high - low)))


UNTOLD = 1.0
"""Log-likelihood ratio to expect, up to which data do not tell two truths apart: odds of e."""

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

    def log_odds(self, truth: Array) -> float:
        """Half the chi-square that the base cannot absorb of a truth.

        Args:
            truth: readings with what is hidden, shape (trials, rows, 4).
        Returns:
            Infinite where a rig runs away: nothing else does that.
        """
        if not np.isfinite(truth).all():
            return float("inf")
        matrix = np.vstack([self.columns, self.prior])
        scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-12)
        target = np.concatenate([self._flat(truth), np.zeros(len(self.prior))])
        moves = np.linalg.lstsq(matrix / scale, target, rcond=1e-9)[0]
        return 0.5 * float(np.sum((target - matrix / scale @ moves) ** 2))

    def _flat(self, readings: Array) -> Array:
        """Change of the measured readings, over the noise."""
        change = (readings - self.base) / self.experiment.noise
        return change[self.experiment.measured].ravel()


def _steps_known(name: str, value: float) -> float:
    """One over what is known of a parameter beforehand, in steps of `neighbours`."""
    return ABSOLUTE.get(name, SHARE * abs(value)) / KNOWN_ABSOLUTE.get(name, KNOWN * abs(value))


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
