"""Greatest likelihood of the innovations, by Fisher scoring.

The score of a reading with innovation e and variance S is -(e / S) e' - (1 - e^2 / S) S' / (2 S),
its expected information e' e' / S + S' S' / (2 S^2). Derivatives come from points that lie a small
step away, those of numbers of single trials together, in the lanes of one run; so do the steps of
eight damping factors (Levenberg and Marquardt), of which the best is taken.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pma_gym.estimation.innovations import TRIAL, GreyBox, Point, is_rugged, log_likelihood

Array = NDArray[np.float64]

STEP = 1e-4
"""Step of derivatives, in units of a coordinate."""

WIDE_STEPS = 3e-2, 3e-3
"""The same where a likelihood is rugged, one after the other, and `STEP` last.

Where friction turns a row earlier or later the likelihood jumps, and a short step sees no slope but
that of a jump. So the information is of steps of a standard error, at most the first of these.
"""

RUNAWAY = 1e100
"""Slope of an innovation from which on the filter beside the point has run away and tells none."""

MOST_ITERATIONS, LEAST_GAIN = 40, 0.05
"""Of a fit; it ends where an iteration gains less."""

ROUGH = 25, 0.3
"""The same of a fit that is only compared with others."""

FACTORS = (0.0, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
"""Damping of the steps that are tried at once, in units of the present one."""

WIDEST = 3.0
"""Longest step, in units of a coordinate."""

BLOCKS = 60
"""Pieces of all readings whose scores are taken as independent of each other, for the intervals."""

OTHERS = ("memory", "delay", "clock", "colour", "colour_memory")
"""Numbers of a point that are no parameters of its model."""


@dataclass(frozen=True)
class Coordinate:
    """One free number of a fit.

    Attributes:
        name: slot of a parameter, `noise N`, `force N` (of trial N), or one of `OTHERS`.
        scale: size (SI) of one unit.
        logarithmic: whether the coordinate is the logarithm.
        lower: least value (SI).
        upper: greatest value (SI).
        prior: standard deviation about the start, in its own unit; 0 for none.
    """

    name: str
    scale: float = 1.0
    logarithmic: bool = False
    lower: float = -np.inf
    upper: float = np.inf
    prior: float = 0.0

    @property
    def trial(self) -> int | None:
        """Number of the only trial that it changes; None if it changes all."""
        latent = self.name.startswith("force ")
        alone = self.name.removeprefix("force ") if latent else self.name.partition(TRIAL)[2]
        return int(alone) if alone else None

    def of(self, point: Point) -> float:
        """The coordinate of a point."""
        value = value_of(point, self.name)
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def value(self, x: float) -> float:
        """The number (SI) at a coordinate, within its bounds."""
        raw = np.exp(np.clip(x, -700.0, 700.0)) if self.logarithmic else x * self.scale
        return float(np.clip(raw, self.lower, self.upper))

    def within(self, x: float) -> float:
        """The coordinate within its bounds."""
        value = self.value(x)
        return float(np.log(value)) if self.logarithmic else value / self.scale


def value_of(point: Point, name: str) -> float:
    """A number of a point by its coordinate's name."""
    kind, _, number = name.partition(" ")
    if number:
        return (point.deviations if kind == "noise" else point.forces)[int(number)]
    return getattr(point, name) if name in OTHERS else point.numbers[name]


def with_values(point: Point, values: Mapping[str, float]) -> Point:
    """A point with other numbers."""
    deviations = tuple(values.get(f"noise {i}", old) for i, old in enumerate(point.deviations))
    forces = tuple(values.get(f"force {i}", old) for i, old in enumerate(point.forces))
    other = {name: values[name] for name in OTHERS if name in values}
    own = {n: v for n, v in values.items() if n not in OTHERS and " " not in n}
    return replace(
        point, numbers={**point.numbers, **own}, deviations=deviations, forces=forces, **other
    )


@dataclass(frozen=True)
class Fit:
    """The greatest likelihood from one start.

    Attributes:
        point: where it is.
        value: its log likelihood, less the penalty of priors.
        coordinates: what was free.
        tied: slots that follow another slot.
        information: expected information, shape (p, p), in the coordinates' units.
        scores: of each block of readings, shape (blocks, p).
    """

    point: Point
    value: float
    coordinates: tuple[Coordinate, ...]
    tied: Mapping[str, str]
    information: Array
    scores: Array

    @cached_property
    def curvature(self) -> Array:
        """Covariance that the expected information alone gives, shape (p, p), in these units."""
        return np.asarray(np.linalg.pinv(self.information), float)

    @cached_property
    def deviations(self) -> dict[str, float]:
        """Standard errors (SI) by name, by the sandwich of information and scores."""
        bread = self.curvature
        meat = self.scores.T @ self.scores
        wide = np.maximum(np.diag(bread @ meat @ bread), np.diag(bread))
        errors = np.sqrt(np.maximum(wide, 0.0))
        sizes = [
            value_of(self.point, c.name) if c.logarithmic else c.scale for c in self.coordinates
        ]
        return {
            c.name: float(e * abs(s))
            for c, e, s in zip(self.coordinates, errors, sizes, strict=True)
        }

    def moved(self, name: str, x: float) -> Point:
        """The point with one coordinate elsewhere."""
        coordinate = next(c for c in self.coordinates if c.name == name)
        return with_values(self.point, with_tied({name: coordinate.value(x)}, self.tied))


def with_tied(values: Mapping[str, float], tied: Mapping[str, str]) -> dict[str, float]:
    """Values with those of the slots that follow them."""
    return {**values, **{slot: values[of] for slot, of in tied.items() if of in values}}


def fit(
    box: GreyBox,
    start: Point,
    coordinates: Sequence[Coordinate],
    tied: Mapping[str, str],
    rough: bool = False,
    near: bool = False,
) -> Fit:
    """Greatest likelihood from a start.

    Args:
        box: the filter.
        start: where to begin, and the middle of the priors.
        coordinates: what is free.
        tied: slots that follow another slot.
        rough: whether to end early, for a comparison of starts.
        near: whether the start is where another fit ended.
    """
    most, least = ROUGH if rough else (MOST_ITERATIONS, LEAST_GAIN)
    origin = np.array([c.of(start) for c in coordinates])
    weight = np.array([1.0 / c.prior**2 if c.prior else 0.0 for c in coordinates])

    def point(x: Array) -> Point:
        values = {c.name: c.value(v) for c, v in zip(coordinates, x, strict=True)}
        return with_values(start, with_tied(values, tied))

    def within(x: Array) -> Array:
        return np.array([c.within(v) for c, v in zip(coordinates, x, strict=True)])

    def valued(xs: Sequence[Array]) -> tuple[Array, list[tuple[Array, Array]]]:
        results = box.innovations([point(x) for x in xs])
        penalty = 0.5 * np.array([weight @ (x - origin) ** 2 for x in xs])
        return log_likelihood(results, box.rows) - penalty, results

    x, damping, p = within(origin), 1e-3, len(coordinates)
    together, of = _together(coordinates, len(box.rows))
    best = float(valued([x])[0][0])
    information, scores = np.eye(p), np.zeros((BLOCKS, p))
    sizes = [*(WIDE_STEPS if is_rugged(box.model) and not near else ()), STEP]
    # A start whose filter fails has no slopes to go by: it is less likely than any other.
    for _ in range(most if np.isfinite(best) else 0):
        size = sizes[0]
        signs = np.where(within(x + size) > x, size, -size)
        beside = valued([x, *(x + signs * together)])[1]
        information, scores = _scored(box, beside, signs, of, 0 * of)
        gradient = scores.sum(axis=0) - weight * (x - origin)
        information += np.diag(weight)
        # What is at an end of its range and drawn beyond it takes no part in the step.
        out = (within(x + size * np.sign(gradient)) == x) & (gradient != 0.0)
        steps = [within(x + step) for step in _damped(information, gradient, out, damping)]
        at = int(np.argmax(values := valued(steps)[0]))
        gain = float(values[at]) - best
        if gain > 0.0:
            x, best = steps[at], float(values[at])
            damping = float(np.clip(damping * 10.0 ** (at - 2), 1e-6, 1e3))
        if not (sizes := sizes if gain > least else sizes[1:]):
            break
    if is_rugged(box.model) and not rough and np.isfinite(best):
        information, scores = _at_standard_errors(box, valued, within, x, (together, of), weight)
    return Fit(point(x), best, tuple(coordinates), dict(tied), information, scores)


def _at_standard_errors(
    box: GreyBox,
    valued: Callable[[Sequence[Array]], tuple[Array, list[tuple[Array, Array]]]],
    within: Callable[[Array], Array],
    x: Array,
    runs: tuple[NDArray[np.bool_], NDArray[np.int64]],
    weight: Array,
) -> tuple[Array, Array]:
    """Information and scores by what lies a standard error before and after each coordinate.

    The standard errors are those by `WIDE_STEPS`; `runs` are those of `_together`.
    """
    (together, of), errors = runs, np.full(len(x), WIDE_STEPS[0])
    last, information, scores = np.where(of, of + len(together), 0), np.empty(0), np.empty(0)
    for _ in range(2):
        ahead, behind = within(x + errors), within(x - errors)
        beside = [x + (end - x) * row for end in (ahead, behind) for row in together]
        passed = np.maximum(ahead - behind, STEP)
        information, scores = _scored(box, valued([x, *beside])[1], passed, of, last)
        information += np.diag(weight)
        spread = np.diag(np.asarray(np.linalg.pinv(information), float))
        errors = np.clip(np.sqrt(np.maximum(spread, 0.0)), STEP, WIDE_STEPS[0])
    return information, scores


def _together(
    coordinates: Sequence[Coordinate], trials: int
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Which coordinates move in one run: numbers of different single trials do.

    Returns:
        What moves in each run, shape (runs, p), and the run that each coordinate moves in by trial,
        shape (trials, p); 0 where it changes nothing.
    """
    moves = np.zeros((len(coordinates),) * 2, bool)
    of, taken = np.zeros((trials, len(coordinates)), int), list[set[int]]()
    for i, coordinate in enumerate(coordinates):
        here = set(range(trials)) if coordinate.trial is None else {coordinate.trial}
        run = next((k for k, others in enumerate(taken) if not others & here), len(taken))
        taken[run:] = [set().union(*taken[run : run + 1], here), *taken[run + 1 :]]
        moves[run, i] = True
        of[list(here), i] = run + 1
    return moves[: len(taken)], of


def _damped(
    information: Array, gradient: Array, out: NDArray[np.bool_], damping: float
) -> list[Array]:
    """Steps of all damping factors, shape (p,) each; what is out takes no part."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    normal, steps = information / np.outer(scale, scale), []
    normal[out, :] = normal[:, out] = 0.0
    for factor in FACTORS:
        ridge = (damping * factor + 1e-10) * np.eye(len(scale)) + np.diag(out.astype(float))
        step = np.linalg.solve(normal + ridge, np.where(out, 0.0, gradient) / scale) / scale
        # Each by itself: what the readings tell nothing of must not hold the others back.
        steps.append(np.clip(step, -WIDEST, WIDEST))
    return steps


def _scored(
    box: GreyBox,
    results: Sequence[tuple[Array, Array]],
    passed: Array,
    of: NDArray[np.int64],
    behind: NDArray[np.int64],
) -> tuple[Array, Array]:
    """Expected information (p, p) and scores (blocks, p) from runs at and beside a point.

    `of` and `behind` are the runs after and before each coordinate has `passed` so much, by trial,
    shape (trials, p).
    """
    slopes, sizes = [], []
    with np.errstate(all="ignore"):
        every = zip(results, box.rows, of, behind, strict=True)
        for (errors, spreads), trial, runs, before in every:
            mask = trial.there.ravel()
            e, s = (a.reshape(len(a), -1)[:, mask] for a in (errors, spreads))
            root = np.sqrt(s[0])
            de = (e[runs] - e[before]) / (passed[:, None] * root)
            ds = (np.log(s[runs]) - np.log(s[before])) / passed[:, None]
            bad = ~((np.abs(de) < RUNAWAY) & np.isfinite(ds))
            slopes.append(np.where(bad, 0.0, np.stack([de, ds])))
            white = e[0] / root
            sizes.append(np.stack([white, 1.0 - white**2]))
    (de, ds), (white, short) = np.concatenate(slopes, axis=2), np.concatenate(sizes, axis=1)
    scores = -(de * white + 0.5 * ds * short)
    edges = np.linspace(0, scores.shape[1], BLOCKS + 1).astype(int)[:-1]
    return de @ de.T + 0.5 * ds @ ds.T, np.add.reduceat(scores, edges, axis=1).T
