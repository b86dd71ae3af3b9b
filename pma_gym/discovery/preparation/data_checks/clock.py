"""A clock that cannot be in seconds: sample numbers, milliseconds, minutes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.datasets.dataset import NamedTrial
from pma_gym.discovery.preparation.data_checks.simulated import Pair, pairs
from pma_gym.discovery.thresholds import (
    CLEAR_RATE,
    FASTEST_S,
    LOG_ROWS,
    SAME_RATE,
    SLOWEST_S,
    SMOOTH,
    USUAL_STEP_S,
)
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

RATES_HZ = (
    *(10.0, 20.0, 25.0, 50.0, 60.0, 64.0, 100.0, 120.0, 125.0, 128.0, 200.0, 250.0, 256.0, 384.0),
    *(400.0, 500.0, 512.0, 1000.0, 1024.0, 2000.0, 5000.0, 10000.0),
)
"""Usual rates of loggers."""

MILLISECONDS_HZ, ROUNDED_S = 1000.0, 1e-6
"""Rate at which rows are milliseconds; how far a step of a second may be rounded (s)."""

FEW, STILL_SPAN = 8, 1e-9
"""Readings, and their simulated span (SI), up to which a signal tells no rate."""


def wrong_clock(named: Sequence[NamedTrial], model: Model) -> tuple[str, float] | None:
    """Whether the time of some trials cannot be in seconds.

    Returns:
        What to say, and the factor that makes seconds of it, 0 where it is not known; None where
        the time may be right.
    """
    dense = [each for each in named if len(each.trial) >= LOG_ROWS and _moves_smoothly(each)]
    steps = [float(np.median(np.diff(each.trial.time))) for each in dense]
    if not dense or 2 * len(dense) < len(named):
        return None
    step = float(np.median(steps))
    names = ", ".join(each.name for each in dense[:3]) + (" ..." if dense[3:] else "")
    if step >= SLOWEST_S:
        return _too_slow(dense, names, step, model)
    if 0.0 < step < FASTEST_S:
        return _too_fast(names, step)
    return None


def _moves_smoothly(each: NamedTrial) -> bool:
    """Whether rows follow each other as samples of one course, which moves."""
    for values in each.trial.measurements.values():
        there = values[np.isfinite(values)]
        span = float(np.ptp(there)) if there.size else 0.0
        if there.size < LOG_ROWS or span == 0.0:
            continue
        # Nine of ten rows: a step is one row, and noise is none of a signal that moves.
        if float(np.quantile(np.abs(np.diff(there)), 0.9)) < SMOOTH * span:
            return True
    return False


def _too_slow(
    dense: Sequence[NamedTrial], names: str, step: float, model: Model
) -> tuple[str, float]:
    rows = "one row a second" if abs(step - 1.0) < ROUNDED_S else f"one row every {step:.4g} s"
    said = f"time_s of {names} has {rows}, which cannot show this rig: "
    if abs(step - 1.0) > ROUNDED_S:
        return f"{said}is it in milliseconds?", 1e-3
    rate = _likely_rate(dense, model)
    if rate == MILLISECONDS_HZ:
        return f"{said}is it in milliseconds, or the row's number at 1000 Hz?", 1e-3
    near = "" if rate is None else f" (by the model, somewhere near {rate:g})"
    return (
        f"{said}is it the row's number? Its factor is then 1 / (samples a second){near}; for 100 "
        "samples a second"
    ), 0.01


def _likely_rate(dense: Sequence[NamedTrial], model: Model) -> float | None:
    """The rate at which the model follows the readings best, None where several are as good."""
    few = dense[:4]
    misfits = {}
    for rate in RATES_HZ:
        timed = [replace(each.trial, time=each.trial.time / rate) for each in few]
        timed_pairs = pairs(model, timed)
        if len(timed_pairs) == len(few):
            misfits[rate] = float(np.mean([_misfit(pair) for pair in timed_pairs]))
    if len(misfits) <= 1:
        return None
    best = min(misfits, key=lambda rate: misfits[rate])
    others = [
        left for rate, left in misfits.items() if not SAME_RATE[0] < rate / best < SAME_RATE[1]
    ]
    return best if misfits[best] <= CLEAR_RATE * min(others, default=np.inf) else None


def _misfit(pair: Pair) -> float:
    """Share of the readings' variance that the simulation does not follow."""
    left = []
    for quantity in pair.trial.measurements:
        _, simulated, measured = pair.signal(quantity)
        if measured.size > FEW and np.ptp(simulated) > STILL_SPAN:
            columns = np.stack([simulated, np.ones(simulated.size)], axis=1)
            coefficients, *_ = np.linalg.lstsq(columns, measured, rcond=None)
            left.append(np.var(measured - columns @ coefficients) / max(np.var(measured), 1e-300))
    return float(np.mean(left)) if left else np.inf


def _too_fast(names: str, step: float) -> tuple[str, float]:
    said = f"time_s of {names} has {1.0 / step:.3g} rows a second, faster than any such rig's log: "
    for words, factor in (("in minutes", 60.0), ("in thousands of seconds", 1e3)):
        if USUAL_STEP_S[0] <= step * factor <= USUAL_STEP_S[1]:
            return f"{said}is it {words}?", factor
    for words, factor in (("in hours", 3600.0), ("in days, a spreadsheet's", 86400.0)):
        if USUAL_STEP_S[0] <= step * factor <= USUAL_STEP_S[1]:
            return f"{said}is it {words}?", factor
    return f"{said}is it in another unit than seconds?", 0.0
