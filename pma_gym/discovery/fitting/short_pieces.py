"""Short pieces of a free rig's trials, begun where the rig moves fastest.

An error of force leads a free rig away with the square of time, and one missed stick with it. In
short pieces, each with its own start, chi-square is smoother. A piece is simulated with relaxed
bristles, so it begins where the rig moves fastest: there they slip within a hundredth of a row,
whatever they were.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.signals import SIGNALS
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.fit_problem import FitProblem
from pma_gym.estimation.logged import Logged
from pma_gym.plant.model import Model

SHORT_S, LEAST_ROWS = 0.25, 12
"""About how long pieces are (s), and how many readings they have at least about."""

MOST_PIECES = 100
"""How many pieces are taken at most."""

Array = NDArray[np.float64]


def in_short_pieces(problem: FitProblem, most: int = MOST_PIECES) -> FitProblem:
    """The same problem with short pieces of its trials; as it is where none can be cut, or are.

    Mains lines and drifts are left out of the noise: a piece is too short to tell of them.

    Args:
        problem: the trials.
        most: how many pieces are taken at most, evenly over the trials.
    """
    if problem.wholes:
        return problem
    cut = [
        (whole, piece)
        for whole, trial in enumerate(problem.trials)
        for piece in _pieces(trial)
        if _is_measured(problem.given, piece)
    ]
    if not cut:
        return problem
    places = np.linspace(0, len(cut) - 1, min(most, len(cut))).round().astype(int)
    taken = [cut[place] for place in np.unique(places)]
    return replace(
        problem,
        trials=[piece for _, piece in taken],
        noise=tuple(replace(each, lines=(), drift=0.0) for each in problem.noise),
        files=tuple(problem.files[whole] for whole, _ in taken) if problem.files else (),
        wholes=tuple(whole for whole, _ in taken),
    )


def _pieces(trial: Trial) -> list[Trial]:
    """Pieces of a trial, each from the fastest row of a stretch to that of the next."""
    rows = max(LEAST_ROWS, round(SHORT_S * (len(trial) - 1) / trial.duration))
    count = max(1, round(len(trial) / rows))
    speeds = _speeds(trial)
    edges = np.linspace(0, len(trial), count + 1).round().astype(int)
    fastest = [
        start + int(np.argmax(speeds[start:stop]))
        for start, stop in zip(edges, edges[1:], strict=False)
    ]
    begun = [fastest[0]]
    for row in (*fastest[1:], len(trial)):
        if row - begun[-1] >= LEAST_ROWS // 2:
            begun.append(row)
    return [_part(trial, start, stop) for start, stop in zip(begun, begun[1:], strict=False)]


def _part(trial: Trial, start: int, stop: int) -> Trial:
    return Trial(
        trial.time[start:stop],
        {name: values[start:stop] for name, values in trial.commands.items()},
        {name: values[start:stop] for name, values in trial.measurements.items()},
        provenance=trial.provenance,
    )


def _is_measured(model: Model, piece: Trial) -> bool:
    """Whether a piece has readings enough for a start of its own and something more."""
    try:
        return Logged.of(model, 0, piece).count >= LEAST_ROWS // 2
    except ValueError:
        # All of its readings are at an end of their sensor.
        return False


def _speeds(trial: Trial) -> Array:
    """How fast a rig moves in each row; zeros where nothing tells."""
    for name, values in trial.measurements.items():
        known = np.isfinite(values)
        if known.sum() < LEAST_ROWS // 2:
            continue
        filled = np.interp(trial.time, trial.time[known], values[known])
        if SIGNALS[name].is_position:
            return np.abs(np.gradient(filled, trial.time))
        if SIGNALS[name].is_speed:
            return np.abs(filled)
    return np.zeros(len(trial))
