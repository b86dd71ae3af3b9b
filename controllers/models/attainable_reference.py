"""The reference of a feed-forward, without what no actuator can follow.

A jump takes time. The plant goes as its voltage can drive it,

    |y'| = s g / tau * (10 V - V(y)) up,   s g / tau * V(y) down,

V(y) being what holds y, g and tau the static gain and the lag there; a share s of the voltage's way
to its limit, for inertia and feedback need some. The way begins half its time before the jump and
ends as long after, where the squared error is least. What an action delay keeps from being followed
at the start is left out: the motion begins where the first command is in force.
"""

import numpy as np

from controllers.models.local_model import Stroke
from controllers.models.voltage import VOLTAGE_LIMIT

JUMP_SHARE = 0.02
"""Share of the range beyond which a change within a step of the inverse, 2 ms at most, is a jump:
the fastest motion that is meant to be followed goes 0.12 % of its range in that time."""

DRIVEN_SHARE = 0.7
"""Share s of the voltage's way to its limit that is planned with."""

SLOWEST = 0.5
"""Least speed planned, in ranges a second: near the cable's slack hardly anything drives back."""


def jumps(wanted: np.ndarray, span: float) -> np.ndarray:
    """Indices of nodes after which a reference jumps.

    Args:
        wanted: the reference at the nodes (m or rad), shape (n,).
        span: range of the task (m or rad).
    """
    return np.flatnonzero(np.abs(np.diff(wanted)) > JUMP_SHARE * span)


def begun_late(wanted: np.ndarray, first: int) -> np.ndarray:
    """The reference, but at rest up to a node: no command is in force before."""
    planned = wanted.copy()
    planned[: first + 1] = wanted[0]
    return planned


def without_jumps(
    wanted: np.ndarray, first: int, step: float, stroke: Stroke, span: float
) -> np.ndarray:
    """The reference with ways in place of its jumps.

    Args:
        wanted: the reference at the nodes (m or rad), shape (n,).
        first: the first node from which the plant can be moved.
        step: time between nodes (s).
        stroke: how the plant answers along the stroke.
        span: range of the task (m or rad).
    """
    planned = wanted.copy()
    for at in jumps(wanted, span).tolist():
        way = _way(float(wanted[at]), float(wanted[at + 1]), step, stroke, SLOWEST * span)
        start = max(at + 1 - len(way) // 2, first)
        part = planned[start : start + len(way)]
        part[:] = way[: len(part)]
    return planned


def _way(start: float, end: float, step: float, stroke: Stroke, slowest: float) -> list[float]:
    """Positions every step from one to another as fast as the voltage drives them."""
    up, way = end > start, [start]
    while (way[-1] < end) == up:
        at = stroke.nearest(way[-1])
        local, held = stroke.models[at], stroke.volts[at]
        left = VOLTAGE_LIMIT - held if up else held
        speed = max(DRIVEN_SHARE * local.gain / local.time_constant * left, slowest)
        way.append(way[-1] + (speed if up else -speed) * step)
    way[-1] = end
    return way
