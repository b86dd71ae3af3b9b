"""Hum of the sensors: a line in the readings that the rig does not move with, taken out of them.

A hum is linear in the innovations of a linear filter, so its waves and its frequency are found by a
few steps of Gauss and Newton on a filter that follows whatever moves. No model need be right.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pma_gym.discovery.grey_box.latent_law import line_power
from pma_gym.discovery.grey_box.prepared_trials import Hum, PreparedTrials
from pma_gym.discovery.grey_box.thresholds import LIKE
from pma_gym.estimation.innovations import Point, Rows

Array = NDArray[np.float64]

ROUNDS, MOST_HUMS, STIFF, BESIDE, SHIFT, SHOWS = 4, 3, 0.1, 201, 0.01, 1e-6
"""For the numerics.

Steps of Gauss and Newton; lines that are looked for; latent force, as a share of the drive's, with
which the filter follows whatever moves; points of the spectrum that a line stands out of; for
derivatives, periods by which another frequency differs over the longest trial; and what a wave
changes at least, as a share of what the others do.
"""

MOVED = 1.5
"""How many times what is left of a line the filter expects of it where the rig moves.

Measured: 0.3 to 1.06 times for five hums, of which it follows a part; 2.4 times and more for eight
motions. Beside a louder motion less than its inverse: a line of a drive's lag had 0.85.
"""


def without_hum(trials: PreparedTrials) -> PreparedTrials:
    """The trials with their hum taken out of the readings, which `trials.hums` lists."""
    for _ in range(MOST_HUMS):
        hums = [hum for at in range(len(trials.channels)) if (hum := _hum(trials, at))]
        if not hums:
            break
        trials = trials.without([*trials.hums, *hums])
    return trials


@dataclass(frozen=True)
class _Followed:
    """What a filter that follows whatever moves makes of one signal, of each trial.

    Attributes:
        times: of the rows (s).
        left: innovations (SI).
        expected: what the filter expects (SI).
        white: innovations of all signals and trials, in their deviations.
        sizes: their number in each trial.
    """

    times: list[Array]
    left: list[Array]
    expected: list[Array]
    white: Array
    sizes: list[int]


def _followed(trials: PreparedTrials, at: int, hum: Hum | None = None) -> _Followed:
    """The same without a hum."""
    # Without dry friction, and what else is of the way: a filter with it is not linear.
    rugged = [e.name for e in trials.model.effects.values() if e.rate_independent_law]
    kept = {name: p for name, p in trials.model.parameters.items() if name not in rugged}
    box = trials.box(replace(trials.model, parameters=kept))
    every = trials.span / (trials.stride * trials.block)
    rows = [_without(each, at, hum, i, every) if hum else each for i, each in enumerate(box.rows)]
    forces = (STIFF * trials.force,) * len(rows)
    point = Point(box.numbers(), tuple(trials.noise), forces, trials.memory[0])
    results = box.innovations([point], rows)
    times, left, expected, white = [], [], [], []
    for each, (errors, spreads) in zip(rows, results, strict=True):
        know = each.measured[:, at]
        times.append(each.time[know])
        left.append(errors[0, know, at])
        expected.append(each.readings[know, at, 0] - errors[0, know, at])
        white.append((errors[0] / np.sqrt(spreads[0]))[each.there])
    return _Followed(times, left, expected, np.concatenate(white), list(map(len, white)))


def _without(rows: Rows, at: int, hum: Hum, number: int, every: float) -> Rows:
    """A trial's rows, of readings every so many seconds, without a hum in one signal."""
    other = copy(rows)
    other.readings = rows.readings.copy()
    # The mean over a block of readings hums less.
    turn, size = np.pi * hum.hertz * every, rows.sizes[0]
    other.readings[:, at, 0] -= (
        np.sin(size * turn) / (size * np.sin(turn)) * hum.of(number, rows.time)
    )
    other.finer = rows.finer and _without(rows.finer, at, hum, number, every)
    return other


def _hum(trials: PreparedTrials, at: int) -> Hum | None:
    """The line that stands out most in the readings of one signal where the rig does not move.

    Beside those that are taken out. None where it is not worth its price: that of a wave in every
    single trial, and of a frequency among those of the spectrum. Nor where most readings stand
    still in one step, which a hum would leave.
    """
    rows = trials.box(trials.model).rows
    if 2 * sum(r.there[:, at].sum() for r in rows) < sum(r.measured[:, at].sum() for r in rows):
        return None
    before = _followed(trials, at)
    hertz, power, _ = line_power(before.times, before.left)
    # A noise with a colour has no line: against what is left around it.
    around = median_filter(power, BESIDE, mode="mirror")
    width = 1.0 / min(float(time[-1] - time[0]) for time in before.times)
    taken = [each.hertz for each in trials.hums if each.channel == trials.channels[at]]
    free = [~np.any(np.abs(np.array(taken) - each) < width) for each in hertz]
    stands, most = power / np.maximum(around, 1e-300) * free, MOVED
    while True:
        loudest = int(np.argmax(stands))
        if not stands[loudest] > 1.0:
            return None
        rows = before.expected, before.left
        moved, left = (_power(hertz[loudest], before.times, each) for each in rows)
        if moved <= most**2 * left:
            break
        # The rig moves there: the next one, less of which is to be a motion.
        most = 1.0 / MOVED
        stands[np.abs(hertz - hertz[loudest]) < width] = 0.0
    hum = Hum(trials.channels[at], float(hertz[loudest]), [0j] * len(before.times))
    now = before
    for _ in range(ROUNDS):
        closer = _nearer(trials, at, hum, now)
        after = _followed(trials, at, closer)
        if np.sum(after.white**2) > np.sum(now.white**2):
            break
        hum, now = closer, after
    # Against what is left at its frequency, whatever the noise and the motion elsewhere: of two
    # waves in every trial, in deviations of the innovations.
    clean = line_power(now.times, now.left)[1]
    usual = median_filter(clean, BESIDE, mode="mirror")[loudest] / (2 * len(now.sizes))
    level = usual * np.sum(now.white**2) / sum(float(row @ row) for row in now.left)
    firsts = np.cumsum([0, *now.sizes[:-1]])
    gains = 0.5 * np.add.reduceat(before.white**2 - now.white**2, firsts) / level
    waves = np.log(np.array(now.sizes))
    beyond = gains.sum() - waves.sum() - 0.5 * np.log(len(now.white)) - np.log(len(hertz))
    return hum if (gains > waves).all() and beyond > LIKE else None


def _nearer(trials: PreparedTrials, at: int, hum: Hum, now: _Followed) -> Hum:
    """A hum with waves, and once it has some with a frequency, by a step of Gauss and Newton."""
    size, count = trials.noise[at], len(now.times)
    shift = SHIFT / max(float(time[-1] - time[0]) for time in now.times)
    others = [replace(hum, waves=[w + step for w in hum.waves]) for step in (size, 1j * size)]
    others += [replace(hum, hertz=hum.hertz + shift)] if any(hum.waves) else []
    slopes = np.array([_followed(trials, at, other).white - now.white for other in others])
    of = np.repeat(np.arange(count), now.sizes)
    columns = [np.where(of == i, slope, 0.0) for slope in slopes[:2] for i in range(count)]
    columns += list(slopes[2:])
    # At half the rate of the readings one of the two waves is none.
    steps = -np.linalg.lstsq(np.array(columns).T, now.white, rcond=SHOWS)[0]
    parts = size * (steps[:count] + 1j * steps[count : 2 * count])
    further = float(np.clip(sum(steps[2 * count :]), -0.3 / SHIFT, 0.3 / SHIFT))
    waves = [w + part for w, part in zip(hum.waves, parts.tolist(), strict=True)]
    return replace(hum, hertz=hum.hertz + shift * further, waves=waves)


def _power(hertz: float, times: Sequence[Array], rows: Sequence[Array]) -> float:
    """Square of a frequency's amplitude in rows, as a tapered transform sees it."""
    pairs = zip(times, rows, strict=True)
    return sum(
        float(abs(np.mean(np.hanning(len(row)) * row * np.exp(-2j * np.pi * hertz * time)))) ** 2
        for time, row in pairs
    )
