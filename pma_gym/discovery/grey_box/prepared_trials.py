"""What the trials of a rig say before any fit, and how a model is run over them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.grey_box.thresholds import FAINT, HORIZON_S, LOUD, STEP_MISS, STEP_SHARE
from pma_gym.discovery.result.misfit import rms
from pma_gym.effects.effect import signals
from pma_gym.estimation.innovations import COLOUR, GreyBox, Point, Rows, is_rugged
from pma_gym.estimation.likelihood_fit import Coordinate
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

ROUGH, CLOSE, FINAL = (10.0, 200_000), (1.0, 200_000), (0.1, 1_000_000)
"""Integration steps are halved until that changes all innovations by less, and their number.

Sum of the changes' squares, in deviations of the innovations, so that log likelihoods are right to
a few units where starts are compared, to one where hypotheses are, and to less at the end. And
steps of all trials together at most: where friction that no model has quite right turns, no step is
short enough.
"""

SHORTEST_S = 1e-4
"""Shortest step (s) where the motion does not turn."""

MISSED, HOPELESS = 4.0, 0.1
"""Mean square of innovations, in their deviations, from which on a point is no fit, and share of
it by which halved steps may change it there."""

MOST_ROWS = 8_000
"""Of all trials together.

More are averaged in blocks, as long as the motion bends less in one than its noise; of what is more
still, every second, third ... block is read.
"""

BENT = 0.2
"""That bend at most, in standard deviations of a block's noise."""

LEAST_FORCE = 1e-9
"""Least latent force, as a share of the drive's."""

MOST_DELAY = 20.0
"""Longest delay, in rows."""

CLOCK = Coordinate("clock", 0.01, False, -0.05, 0.05)
"""Share by which the readings' clock runs fast: quartz 1e-4, a timer in software up to 0.05."""


@dataclass(frozen=True)
class Hum:
    """A line in the readings of one sensor that the rig does not move with.

    Attributes:
        channel: of the rig's signals.
        hertz: its frequency in the readings.
        waves: amplitude and phase in each trial, as complex numbers (SI).
    """

    channel: int
    hertz: float
    waves: Sequence[complex]

    @property
    def amplitude(self) -> float:
        """Root mean square of the amplitudes of all trials (SI)."""
        return rms(np.abs(self.waves))

    def of(self, number: int, time: Array) -> Array:
        """What it adds to one trial's readings at given times (s), of the same shape."""
        return np.real(self.waves[number] * np.exp(2j * np.pi * self.hertz * time))

    def out_of(self, number: int, logged: Logged) -> Logged:
        """A trial without it."""
        measured = logged.measured.copy()
        measured[self.channel] -= self.of(number, np.asarray(logged.time, float))
        return replace(logged, measured=measured)


class PreparedTrials:
    """Trials with their noise, rows and steps, over which models are run.

    Whether commands are linear between rows, and the least integration steps a row, are as the
    likeliest fit so far has them.

    Args:
        model: the model as it came.
        logged: the trials.
        threads: that filters run in at once.
        hums: that are taken out of the readings.
    """

    def __init__(
        self, model: Model, logged: Sequence[Logged], threads: int, hums: Sequence[Hum] = ()
    ) -> None:
        self.model, self.threads, self.hums, self.raw = model, threads, tuple(hums), list(logged)
        self.logged = self.raw
        for hum in hums:
            self.logged = [hum.out_of(i, each) for i, each in enumerate(self.logged)]
        self.linear = False
        self.channels = [
            i for i in range(len(model.rig.signals)) if any(each.measures[i] for each in logged)
        ]
        raw, readings = (
            [[each.measured[c][each.counts[c] > 0] for each in trials] for c in self.channels]
            for trials in (self.raw, self.logged)
        )
        self.steps_of_readings = [reading_step(rows) for rows in raw]
        pairs = list(zip(readings, self.steps_of_readings, strict=True))
        self.noise = [max(white_noise(rows, s), s / 12**0.5) for rows, s in pairs]
        self.coarse = [n < s for n, (_, s) in zip(self.noise, pairs, strict=True)]
        self.block = self._block(readings)
        total = sum(len(each.time) for each in logged) / self.block
        self.stride = max(1, int(total / MOST_ROWS))
        self.steps = max(1, self.stride * self.block // 8)
        self.span = (
            self.stride
            * self.block
            * float(np.median(np.concatenate([np.diff(each.time) for each in logged])))
        )
        longest = max(float(each.time[-1] - each.time[0]) for each in logged)
        self.memory = 4.0 * self.span, max(longest / 5.0, 8.0 * self.span)
        self.noise = [n / self.block**0.5 for n in self.noise]
        self._rows: dict[tuple[int, bool, bool], list[Rows]] = {}
        self.force = self._force()

    def without(self, hums: Sequence[Hum]) -> "PreparedTrials":
        """The same trials with hums taken out."""
        return PreparedTrials(self.model, self.raw, self.threads, hums)

    def _block(self, readings: Sequence[Sequence[Array]]) -> int:
        total, block = sum(len(each.time) for each in self.logged), 1
        while total / block > MOST_ROWS:
            wider = block + 1
            bends = [
                np.sqrt(np.mean(np.concatenate([np.diff(row[::wider], 2) for row in rows]) ** 2))
                / 24.0
                for rows in readings
            ]
            if any(b > BENT * n / wider**0.5 for b, n in zip(bends, self.noise, strict=True)):
                break
            block = wider
        return block

    def _force(self) -> float:
        """Force of the drive (N, N m) at the root mean square of its command."""
        motor = np.concatenate([each.motor for each in self.logged])
        middle = float(np.median(motor))
        level = float(np.sqrt(np.mean((motor - middle) ** 2))) or 1.0
        (drive,) = [e for e in self.model.effects.values() if e.port == self.model.rig.drive_port]
        assert drive.law is not None
        known = {"p": self.model.parameters[drive.name], "spin": 0.0}
        forces = []
        for command in (middle + level, middle):
            at = {**known, "command": command, "motor_voltage": command}
            forces.append(drive.law(*(at[name] for name in signals(drive.law))))
        return abs(forces[0] - forces[1]) or 1.0

    def box(self, model: Model, linear: bool | None = None, steps: int = 0) -> GreyBox:
        """The filter of a model over the trials, with so many integration steps a row.

        Where friction turns nothing is smooth: steps are finer there, and none is extrapolated.
        """
        steps = steps or self.steps
        linear = self.linear if linear is None else linear
        rugged = is_rugged(model)
        key = steps, linear, rugged
        if key not in self._rows:
            how = self.channels, steps, linear, self.block, self.stride, self.coarse
            noise = self.noise if rugged else ()
            self._rows[key] = [Rows(each, *how, not rugged, noise) for each in self.logged]
        return GreyBox(model, self._rows[key], self.channels, self.threads)

    def precise(
        self,
        model: Model,
        point: Point,
        steps: int = 0,
        linear: bool | None = None,
        level: tuple[float, int] = CLOSE,
    ) -> GreyBox:
        """The filter of a model with as many steps as it needs at a point, at least so many."""
        (change, total), rows = level, self.stride * self.block
        steps = steps or self.steps
        box = self.box(model, linear, steps)
        white = self.white(box, [point])
        while (
            2 * steps * SHORTEST_S <= self.span
            and 2 * sum(each.firsts[-1] for each in box.rows) <= total
        ):
            # Where several rows are one step, the next has each by itself.
            steps = rows if steps < rows < 2 * steps else 2 * steps
            finer = self.box(model, linear, steps)
            before, white = white, self.white(finer, [point])
            most = HOPELESS * np.sum(white**2) if self.is_missed(white) else change
            if np.sum((white - before) ** 2) < most:
                break
            box = finer
        return box

    def white(self, box: GreyBox, points: Sequence[Point]) -> Array:
        """Innovations over their deviations, shape (points, readings)."""
        with np.errstate(all="ignore"):
            rows = [
                (errors / np.sqrt(spreads)).reshape(len(points), -1)[:, trial.there.ravel()]
                for (errors, spreads), trial in zip(box.innovations(points), box.rows, strict=True)
            ]
        return np.concatenate(rows, axis=1)

    def is_missed(self, white: Array) -> bool:
        """Whether innovations, in their deviations, are those of a point that is no fit."""
        return not float(np.mean(white**2)) < MISSED

    def nuisances(self) -> list[Coordinate]:
        """Coordinates of the noises, the latent force and the delay."""
        pairs = zip(self.noise, self.steps_of_readings, strict=True)
        noise = [
            Coordinate(f"noise {i}", 1.0, True, max(1e-3 * n, s / 12**0.5), 1e3 * n)
            for i, (n, s) in enumerate(pairs)
        ]
        forces = [
            Coordinate(f"force {i}", 1.0, True, LEAST_FORCE * self.force, 10.0 * self.force)
            for i in range(len(self.logged))
        ]
        least, most = self.memory
        memory = Coordinate("memory", 1.0, True, 0.75 * least, most)
        late = any(effect.port == "drive_delay" for effect in self.model.effects.values())
        delay = [] if late else [Coordinate("delay", self.span, False, 0.0, MOST_DELAY * self.span)]
        return [*noise, *forces, memory, *delay]

    def logging(self, name: str) -> list[Coordinate]:
        """Coordinates of what may be wrong with the logging: `clock` or `colour`.

        Noise that lasts longer than a prediction is drift, which a latent force carries as well.
        """
        if name == CLOCK.name:
            return [CLOCK]
        least, _ = self.memory
        return [
            Coordinate(COLOUR, 1.0, True, 1e-3 * self.noise[0], 1e3 * self.noise[0]),
            Coordinate(f"{COLOUR}_memory", 1.0, True, 0.25 * least, max(least, HORIZON_S)),
        ]

    def is_bent(self, point: Point, share: float = FAINT) -> bool:
        """Whether a latent force, or more noise than the readings show, stands in for something."""
        noisy = [d > LOUD * n for d, n in zip(point.deviations, self.noise, strict=True)]
        return max(point.forces) > share * self.force or any(noisy)


def reading_step(rows: Sequence[Array]) -> float:
    """Step that readings keep to (SI); 0 where they keep to none."""
    levels = np.unique(np.concatenate(rows))
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * max(float(np.abs(levels).max()), 1e-300)]
    if not len(apart):
        return 0.0
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    whole = np.abs(apart / step - np.round(apart / step)) < STEP_MISS
    return step if whole.mean() > STEP_SHARE else 0.0


def white_noise(rows: Sequence[Array], step: float) -> float:
    """Standard deviation of white noise by third differences (squared weights sum to 20).

    Readings are spread over the step that they are rounded to, for the median of whole steps tells
    nothing; the spread's own variance is taken off again.
    """
    spread = np.random.default_rng(0)
    even = [row + step * spread.random(len(row)) for row in rows]
    third = np.concatenate([np.diff(row, 3) for row in even if row[3:].size])
    robust = 1.4826 * float(np.median(np.abs(third)))
    variance = max(robust, 0.3 * float(np.std(third))) ** 2 / 20.0 - step**2 / 12.0
    return max(variance, 1e-25) ** 0.5
