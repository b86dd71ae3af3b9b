"""The reverse: what the station, identified from I2 and I3, misses in tables 21, 22 and 27-30.

Each measured phase of each trial is known by three numbers: slope and intercept of a line, and the
mean square about it. Beside a simulation under the printed voltages they leave three residuals, in
what they make of the position (rms, mm at the muscle): the slope's, the mid-phase position's and
the roughness's. Every candidate of the station is fitted to all of them at once; what is left at a
pressure is then foretold from the others, by the fit's own derivatives.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from benchmarks.reproduction.rotation_reading import reading
from benchmarks.runner.phase_score import PHASES, measured_score
from pma_gym.data.serres2008 import load_table
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.candidate_effect import CandidateEffect, bounds
from pma_gym.discovery.fitting.free_parameters import prior, values
from pma_gym.discovery.preparation.noise import white_noise
from pma_gym.discovery.preparation.whitened_residuals import WhitenedResiduals
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.metrics import PHASE_DURATION, regression
from pma_gym.plant.memory_start import memory_at_start
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.rigs import RIGS
from pma_gym.tasks import EVERY_TASK
from pma_gym.units import SI_FACTORS

Array = NDArray[np.float64]

RATE_HZ = 60.0
"""Rows a second of a simulated trial: the printed voltages fall on them."""

PRINTED = "serres2008"
"""The model with the dissertation's pulley."""

PARAMETERS = (
    "drive.gain_n_per_v",
    "drive.offset_n",
    "rotor.radius_mm",
    "cable.stiffness_n_per_mm",
    "cable.slack_mm",
    "hysteresis.force_n",
    "regulator_line.gain_kpa_per_v",
)
"""Numbers that the station has and that may be off, each set beside the effects that it lacks."""

LIKE = 1.15
"""Explanations whose rms left at pressures left out is within this factor of the best cannot be
told apart."""

GAIN = 0.9
"""A further explanation must leave at most this share of what was left before it."""

NOTHING = "nothing added"

READ_THROUGH_A_GAP = "potentiometer gain and dead gap (a hypothesis)"
GAINS = tuple(0.86 + 0.01 * k for k in range(19))
GAPS_DEG = tuple(float(gap) for gap in range(31))
"""Gains and gaps (deg) that are tried beside the other explanations."""


@dataclass(frozen=True)
class Explanation:
    """One way to explain the misfit.

    Attributes:
        name: the effect, or the parameter.
        values: fitted values in file units, by path.
        fitted_mm: rms left where all pressures were fitted (mm at the muscle).
        left_out_mm: at pressures left out.
        displacement_mm: of that, in the displacement trials.
        rotation_mm: in the rotation trials.
        hypothesis: whether it was thought of when these tables had been seen; it counts as none of
            the model's, and no further explanation is built on it.
    """

    name: str
    values: dict[str, float]
    fitted_mm: float
    left_out_mm: float
    displacement_mm: float
    rotation_mm: float
    hypothesis: bool = False


def explanations(
    model: Model, progress: Callable[[int, int], None] | None = None
) -> list[Explanation]:
    """Every explanation that the catalogue has, the best at pressures left out first.

    The first in the list that adds nothing is the model as it is.
    """
    summary = Summary.measured(model)
    every = [each for each in candidate_effects(model) if _reaches(each)]
    candidates = [summary.explained(NOTHING, model, (), np.empty((1, 0)))]
    total = len(every) + len(PARAMETERS)
    for number, candidate in enumerate(every):
        if progress is not None:
            progress(number, total)
        free = np.flatnonzero(candidate.fitted)
        some = candidate.probes[_spread(len(candidate.probes))]
        switched = candidate.model.replace(
            dict(zip(candidate.paths, candidate.probes[0].tolist(), strict=True))
        )
        paths = tuple(np.array(candidate.paths)[free].tolist())
        candidates.append(summary.explained(candidate.name, switched, paths, some[:, free]))
    for number, path in enumerate(PARAMETERS):
        if progress is not None:
            progress(len(every) + number, total)
        here = values(model, [path])
        candidates.append(
            summary.explained(path, model, (path,), here[None] + 0.5 * prior(model, path))
        )
    candidates.append(read_through_a_gap(summary, model))
    return sorted(candidates, key=lambda each: each.left_out_mm)


def read_through_a_gap(summary: "Summary", model: Model) -> Explanation:
    """The rotation trials read with another gain and a dead gap (`rotation_reading`).

    No motion depends on it, so every gain and gap of a grid is tried, and at each pressure that is
    left out those count that fit the others best: a fit of the others, not a step towards one.
    """
    free = ("drive.offset_n",)
    held = summary.beside(model, free).readings(values(model, free))
    parts = model.parameters
    slack, radius = parts["cable"].slack, parts["rotor"].radius
    grid = [(gain, gap) for gain in GAINS for gap in GAPS_DEG]
    reads = [partial(reading(*pair, slack).of, radius=radius) for pair in grid]
    left = np.array([summary.left(held, read) for read in reads])
    foretold = np.empty(left.shape[1])
    for pressure in np.unique(summary.pressure):
        there = summary.pressure == pressure
        best = int(np.argmin(np.sum(left[:, ~there] ** 2, axis=1)))
        foretold[there] = left[best, there]
    best = int(np.argmin(np.sum(left**2, axis=1)))
    fitted: dict[str, float] = dict(zip(("gain", "gap_deg"), grid[best], strict=True))
    explanation = summary.explanation(READ_THROUGH_A_GAP, fitted, left[best], foretold)
    return replace(explanation, hypothesis=True)


def searched(
    model: Model, most: int = 2, progress: Callable[[int, int], None] | None = None
) -> list[list[Explanation]]:
    """Explanations of the model as it is, then of the model with the best one in it, and so on.

    It ends where the best gains less than a tenth at pressures left out.
    """
    by_round = []
    while len(by_round) < most:
        every = explanations(model, progress)
        by_round.append(every)
        every = [each for each in every if not each.hypothesis]
        before = next(each.left_out_mm for each in every if each.name == NOTHING)
        if every[0].left_out_mm > GAIN * before:
            break
        model = _with(model, every[0])
    return by_round


def _with(model: Model, explanation: Explanation) -> Model:
    """The model with an explanation in it."""
    lacking = {each.name: each for each in candidate_effects(model)}
    if explanation.name in lacking:
        candidate = lacking[explanation.name]
        model = candidate.model.replace(
            dict(zip(candidate.paths, candidate.probes[0].tolist(), strict=True))
        )
    return model.replace(explanation.values)


def alike(explanations: Sequence[Explanation]) -> list[Explanation]:
    """Return explanations that are not distinguishable from the best."""
    least = min(each.left_out_mm for each in explanations)
    return [each for each in explanations if each.left_out_mm <= LIKE * least]


def _reaches(candidate: CandidateEffect) -> bool:
    """Whether an effect is in the true motion, which alone is known, and has a size."""
    sensed = candidate.model.effects[candidate.effect].port.startswith(("sensor", "part"))
    lag = candidate.name.endswith("_lag") and candidate.effect != "drive_lag"
    return bool(candidate.fitted.any()) and not sensed and not lag


def _spread(count: int) -> list[int]:
    """A few of so many probes."""
    return sorted({0, count // 2, count - 1})


@dataclass(frozen=True)
class Summary:
    """Known commands and the figures that were measured under them.

    Attributes:
        trials: the commands, one trial a profile.
        tasks: task of each trial.
        pressure: of each residual (kPa), shape (n,).
        rotation: whether each residual is of a rotation, shape (n,).
        figures: slope, mid-phase position and roughness of all phases, in mm, shape (n,).
    """

    trials: list[Trial]
    tasks: list[str]
    pressure: Array
    rotation: NDArray[np.bool_]
    figures: Array

    @classmethod
    def measured(cls, model: Model) -> "Summary":
        """From the tables; the regulator's voltage is what the model makes the pressure with."""
        plant, begun = Plant(model), memory_at_start(model)
        trials, tasks, pressures, rotation, figures = [], [], [], [], []
        for number in range(4, 21):
            table = load_table(f"I{number}")
            task, pressure = str(table["task"][0]), float(table["pressure_kpa"][0])
            end = PHASE_DURATION * len(PHASES[task])
            time = np.arange(round(end * RATE_HZ) + 1) / RATE_HZ
            volts = np.interp(time, table["time_s"], table["motor_voltage_v"])
            pressed = plant.regulator_voltage(pressure * SI_FACTORS["kPa"])
            trials.append(
                Trial(
                    time,
                    {"motor_voltage": volts, "regulator_voltage": np.full(len(time), pressed)},
                    {"contraction": np.zeros(len(time))},
                    # Its readings are none, so nothing but the model says where it begins.
                    memory_at_start=begun,
                )
            )
            tasks.append(task)
            unit = _millimetres(task)
            for phase in PHASES[task]:
                score = measured_score(task, phase, pressure)
                figures += [
                    score.slope * unit * PHASE_DURATION / np.sqrt(12.0),
                    score.mean * unit,
                    np.sqrt(score.residual_mean_square) * unit,
                ]
                pressures += 3 * [pressure]
                rotation += 3 * [EVERY_TASK[task].schedule.followed.is_angle]
        return cls(trials, tasks, np.array(pressures), np.array(rotation), np.array(figures))

    def residuals(self, whitened: WhitenedResiduals, at: Array) -> Array:
        """Simulated less measured at parameters, shape (n,) in mm; infinite where it is lost."""
        return self.left(whitened.readings(at))

    def beside(self, model: Model, free: Sequence[str]) -> WhitenedResiduals:
        """The trials beside a model, as one that simulates them at parameters."""
        noise = tuple(white_noise(1.0) for _ in RIGS["station"].outputs)
        return WhitenedResiduals(model, self.trials, free, noise, np.full(len(free), np.inf))

    def left(
        self, held: list[Array] | None, read: Callable[[Array], Array] = lambda angle: angle
    ) -> Array:
        """Simulated less measured, shape (n,) in mm; infinite where it is lost.

        Args:
            held: what the sensors hold in each trial, from `WhitenedResiduals.readings`.
            read: what is read at true angles (rad).
        """
        if held is None or not all(np.isfinite(part).all() for part in held):
            return np.full(self.figures.shape, 1e3)
        residuals = []
        for signals, trial, task in zip(held, self.trials, self.tasks, strict=True):
            contraction = signals[RIGS["station"].outputs.index("contraction")]
            position = (
                (contraction[0] - contraction) * 1e3
                if task == "displacement"
                else read(signals[RIGS["station"].outputs.index("rotation")]) * pulley() * 1e3
            )
            for number in range(len(PHASES[task])):
                begin = PHASE_DURATION * number
                inside = (trial.time >= begin) & (trial.time <= begin + PHASE_DURATION)
                line = regression(trial.time[inside] - begin, position[inside])
                residuals += [
                    line.slope * PHASE_DURATION / np.sqrt(12.0),
                    line.intercept + 0.5 * PHASE_DURATION * line.slope,
                    np.sqrt(line.residual_mean_square),
                ]
        return np.clip(np.array(residuals) - self.figures, -1e3, 1e3)

    def explained(self, name: str, model: Model, paths: Sequence[str], begun: Array) -> Explanation:
        """Fit parameters of a model, from the best of some beginnings, shape (starts, p)."""
        # A reading of every parameter keeps the zero free; one that does nothing is always there.
        free = tuple(paths) or ("drive.offset_n",)
        whitened = self.beside(model, free)
        if not paths:
            left = self.residuals(whitened, values(model, free))
            return self.explanation(name, {}, left, left)
        first = min(begun, key=lambda row: float(np.sum(self.residuals(whitened, row) ** 2)))
        lower, upper = bounds(paths)
        inside = np.clip(first, lower + 1e-9, upper - 1e-9)
        fit = least_squares(
            lambda at: self.residuals(whitened, at),
            inside,
            bounds=(lower, upper),
            x_scale=np.maximum(np.abs(inside), 1e-3),
            diff_step=1e-3,
            max_nfev=25,
        )
        fitted = dict(zip(paths, map(float, fit.x), strict=True))
        return self.explanation(name, fitted, fit.fun, self._foretold(whitened, fit))

    def _foretold(self, whitened: WhitenedResiduals, fit: OptimizeResult) -> Array:
        """What is left at each pressure by a fit to the others: one step from the fit of all.

        The step is simulated, and not taken where it does not help at the others.
        """
        residuals, left = fit.fun.copy(), fit.fun
        for pressure in np.unique(self.pressure):
            there = self.pressure == pressure
            step, *_ = np.linalg.lstsq(fit.jac[~there], -left[~there], rcond=1e-8)
            at = np.clip(fit.x + step, whitened.lower, whitened.upper)
            moved = self.residuals(whitened, at)
            if np.sum(moved[~there] ** 2) <= np.sum(left[~there] ** 2):
                residuals[there] = moved[there]
        return residuals

    def explanation(
        self, name: str, fitted: dict[str, float], left: Array, foretold: Array
    ) -> Explanation:
        """An explanation by what it leaves where it is fitted and where it is foretold."""
        return Explanation(
            name,
            fitted,
            _rms(left),
            _rms(foretold),
            _rms(foretold[~self.rotation]),
            _rms(foretold[self.rotation]),
        )


def _millimetres(task: str) -> float:
    """Millimetres at the muscle in the unit that a task is measured in."""
    return 1.0 if task == "displacement" else SI_FACTORS["deg"] * pulley() * 1e3


@cache
def pulley() -> float:
    """Radius of the dissertation's pulley (m), which makes an angle comparable with a way.

    Not that of the model that is explained: it is fitted too, and would change the scale.
    """
    return load_model(PRINTED).parameters["rotor"].radius


def _rms(left: Array) -> float:
    return float(np.sqrt(np.mean(left**2)))
