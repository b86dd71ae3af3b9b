"""Whether what a model leaves of readings that it was not fitted to is noise.

A verdict that denies missing structure (`agrees`, `parameters`) needs it of every signal: the
misfit is at most `COMPLETE` floors, and a flexible regression on state, command and the
command's history explains less than `MOST_EXPLAINED` floors of it. No rig and no sensor is exempt.
Where the readings that the model was fitted to are beyond these limits too, structure is missing.
Where only those left out are, the trials may not determine the parameters: the verdict is
`undecidable`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.preparation.acceptance_floors import REST, AcceptanceFloor, is_summary
from pma_gym.discovery.preparation.noise import (
    Whitening,
    autoregression,
    rest_readings,
    white_noise,
)
from pma_gym.discovery.thresholds import (
    BLOCK_S,
    COMPLETE,
    LEAST_BLOCKS,
    MOST_EXPLAINED,
    SIGNIFICANT,
)
from pma_gym.discovery.verdict.flexible_regression import explained, variables
from pma_gym.estimation.logged import Logged

Array = NDArray[np.float64]

Fault = Literal[
    "misfit", "explained", "not predicted", "follows", "alike", "wide", "no floor", "not left out"
]
"""What is wrong with a signal. Structure is missing: too large a misfit of readings that the model
was fitted to (`misfit`), or a regression that explains too much of them (`explained`). The
verdict is `undecidable`: the same of readings left out alone (`not predicted`, `follows`), a drift
that is alike in all trials (`alike`, `common_drift`), too wide a bound (`wide`), no floor, no
readings that could be left out."""

STRUCTURE: tuple[Fault, ...] = ("misfit", "explained")
OPEN: tuple[Fault, ...] = ("not predicted", "follows", "alike", "wide", "no floor", "not left out")


@dataclass(frozen=True)
class Residual:
    """What a model leaves of trials.

    Attributes:
        simulated: what its sensors hold (SI), shape (signals, rows) for each trial.
        left: simulated less measured (SI), NaN where not measured, shape (signals, rows) for each
            trial.
    """

    simulated: Sequence[Array]
    left: Sequence[Array]


@dataclass(frozen=True)
class SignalAdequacy:
    """What is left of one signal.

    Attributes:
        floor: what it is judged against; None where nothing tells.
        misfit: root mean square of the residual on readings left out, in floors; NaN where unknown.
        explained: of it by the regression, in floors; NaN for a summary, or where unknown.
        bound: upper 95 % bound of that.
        fitted: misfit of the readings that the model was fitted to, in floors.
        fault: what is wrong; None where the signal is adequate.
        common: chance that a sensor drifts as much alike in all trials; NaN where it is no fault.
    """

    floor: AcceptanceFloor | None
    misfit: float = np.nan
    explained: float = np.nan
    bound: float = np.nan
    fitted: float = np.nan
    fault: Fault | None = None
    common: float = np.nan


@dataclass(frozen=True)
class Adequacy:
    """What is left of all signals.

    Attributes:
        signals: by output.
    """

    signals: Mapping[str, SignalAdequacy]

    @property
    def structure(self) -> tuple[str, SignalAdequacy] | None:
        """The signal that shows most that structure is missing, and its name."""
        return self._worst(STRUCTURE)

    @property
    def undecided(self) -> tuple[str, SignalAdequacy] | None:
        """The signal that leaves most open, and its name."""
        return self._worst(OPEN)

    @property
    def alike(self) -> tuple[str, SignalAdequacy] | None:
        """The signal whose drift is most surely alike in all trials, and its name."""
        alike = [item for item in self.signals.items() if item[1].fault == "alike"]
        return min(alike, key=lambda item: item[1].common, default=None)

    def _worst(self, faults: Sequence[Fault]) -> tuple[str, SignalAdequacy] | None:
        """The signal with one of some faults whose misfit is largest, and its name."""
        faulty = [(name, each) for name, each in self.signals.items() if each.fault in faults]
        # NaN, where a misfit is unknown, is the least.
        return max(faulty, key=lambda item: np.nan_to_num(item[1].misfit), default=None)


def adequacy(
    logged: Sequence[Logged],
    unseen: Residual | None,
    fitted: Residual,
    floors: Mapping[str, AcceptanceFloor],
    folds: Sequence[NDArray[np.int64]],
    seed: int,
) -> Adequacy:
    """Judge what a model leaves of readings that it was not fitted to.

    Args:
        logged: the trials.
        unseen: what fits that had not seen them leave; None where nothing could be left out.
        fitted: what the fit of all leaves.
        floors: of the signals that have one.
        folds: of each row of each trial, the part with which it was left out.
        seed: of the bootstrap.
    """
    inside = _Judge(logged, fitted, folds, seed)
    outside = None if unseen is None else _Judge(logged, unseen, folds, seed)
    judged = {}
    for channel, signal in enumerate(logged[0].signals):
        if any(each.measures[channel] for each in logged):
            floor = floors.get(signal.name)
            judged[signal.name] = _judged(outside, inside, channel, floor)
    return Adequacy(judged)


def _judged(
    unseen: "_Judge | None", fitted: "_Judge", channel: int, floor: AcceptanceFloor | None
) -> SignalAdequacy:
    """One signal."""
    if floor is None:
        return SignalAdequacy(None, fault="no floor")
    inside = fitted.misfit(channel, floor)
    if unseen is None:
        missing = inside > COMPLETE
        return SignalAdequacy(floor, fitted=inside, fault="misfit" if missing else "not left out")
    misfit = unseen.misfit(channel, floor)
    if unseen.is_summary(channel):
        # A regression on a few readings a trial learns nothing; the scatter of repeats, a tolerance
        # or the printed errors say what is noise. Rest segments do not.
        fault: Fault | None = "no floor" if floor.source == REST else None
        if misfit > COMPLETE:
            fault = "misfit" if inside > COMPLETE else "not predicted"
        return SignalAdequacy(floor, misfit, fitted=inside, fault=fault)
    share, bound = unseen.explained(channel, floor)
    fault = None
    if inside > COMPLETE:
        fault = "misfit"
    elif misfit > COMPLETE:
        fault = "not predicted"
    elif share >= MOST_EXPLAINED:
        # Parameters that the other readings do not hold leave a residual that follows the state.
        inner, _ = fitted.explained(channel, floor)
        fault = "explained" if inner >= MOST_EXPLAINED else "follows"
    elif bound >= MOST_EXPLAINED:
        fault = "wide"
    return SignalAdequacy(floor, misfit, share, bound, inside, fault)


class _Judge:
    """Judges what a model leaves of trials, signal by signal.

    Args:
        logged: the trials.
        residual: what is left of them.
        folds: the parts between which the regression predicts.
        seed: of the regression and of the bootstrap.
    """

    def __init__(
        self,
        logged: Sequence[Logged],
        residual: Residual,
        folds: Sequence[NDArray[np.int64]],
        seed: int,
    ) -> None:
        self._logged, self._residual, self._folds, self._seed = logged, residual, folds, seed
        measured = np.array([each.measures for each in logged]).any(axis=0)
        self._signals = max(int(measured.sum()), 1)

    @cached_property
    def _variables(self) -> list[Array]:
        return list(map(variables, self._logged, self._residual.simulated))

    def _parts(self, channel: int) -> list[Array]:
        return [left[channel] for left in self._residual.left]

    def is_summary(self, channel: int) -> bool:
        """Whether a signal has a few readings a trial."""
        return is_summary(self._parts(channel))

    def misfit(self, channel: int, floor: AcceptanceFloor) -> float:
        """Root mean square of what is left of a signal, in floors."""
        return float(np.sqrt(np.nanmean(np.concatenate(self._parts(channel)) ** 2))) / floor.level

    def explained(self, channel: int, floor: AcceptanceFloor) -> tuple[float, float]:
        """What the regression explains of a signal's residual, and its upper bound, in floors."""
        noise = _noise(self._logged, channel, floor.level)
        white = [
            _white(noise, part, each.missing[channel])
            for part, each in zip(self._parts(channel), self._logged, strict=True)
        ]
        blocks = _blocks(self._logged)
        share = explained(white, self._variables, self._folds, blocks, self._seed)
        bound = np.inf
        if len(share.counts) >= LEAST_BLOCKS:
            generator = np.random.default_rng([self._seed, channel])
            bound = share.bound(SIGNIFICANT / self._signals, generator)
        return float(np.sqrt(max(share.mean, 0.0))), float(np.sqrt(max(bound, 0.0)))


def _noise(logged: Sequence[Logged], channel: int, level: float) -> Whitening:
    """What makes a signal's noise white, as seen at rest, and its floor 1.

    At rest alone: an autoregression of the residual would take missing structure for noise.
    """
    segments = rest_readings(logged, channel)
    learnt = autoregression(segments, 0.0) if segments else white_noise(1.0)
    share = learnt.innovation / learnt.level if learnt.level > 0.0 else 1.0
    return Whitening(learnt.coefficients, share * level, level)


def _white(noise: Whitening, residual: Array, missing: NDArray[np.int64]) -> Array:
    """A whitened residual, NaN where a reading that it needs is missing."""
    there = np.isfinite(residual)
    white = noise.white(np.where(there, residual, 0.0), missing)
    return np.where(there, white, np.nan)


def _blocks(logged: Sequence[Logged]) -> list[NDArray[np.int64]]:
    """Number of each row's block; no two trials share one."""
    blocks, first = [], 0
    for each in logged:
        duration = float(each.time[-1] - each.time[0])
        count = max(1, round(duration / BLOCK_S))
        places = (each.time - each.time[0]) * (count / max(duration, 1e-300) * (1.0 - 1e-12))
        blocks.append(first + places.astype(np.int64))
        first += count
    return blocks
