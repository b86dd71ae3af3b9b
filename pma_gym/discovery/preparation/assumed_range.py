"""The range that a fit allows a parameter: what was assumed beforehand, within what is possible.

A parameter may lie `FARTHEST` standard deviations of its prior away from where it is expected.
Where a fit ends at that edge, the edge is only an assumption: it is doubled while the fit gains.
What the catalogue allows (a mass above 0) is never left.
"""

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.thresholds import FARTHEST, MOST_DOUBLINGS

Array = NDArray[np.float64]

AT_EDGE = 1e-9
"""Distance from an edge, as a share of the range, within which a value is at the edge."""


def assumed_range(
    centre: Array, prior: Array, lower: Array, upper: Array, reach: Array
) -> tuple[Array, Array]:
    """Least and largest values that a fit allows parameters, shape (p,) each.

    Args:
        centre: expected values.
        prior: standard deviations about them; infinite where nothing is assumed.
        lower: least values that the catalogue allows.
        upper: largest.
        reach: how many times as wide as assumed each range is.
    """
    away = FARTHEST * prior
    low, high = centre - reach * away, centre + reach * away
    # A number that is positive by nature shrinks by halves: it never crosses 0, where a rig of no
    # mass would take an integrator for ever.
    shrinks = (lower >= 0.0) & (centre - away > 0.0)
    low = np.where(shrinks, (centre - away) / reach, low)
    return np.maximum(low, lower), np.minimum(high, upper)


def at_assumed_edge(
    values: Array, low: Array, high: Array, lower: Array, upper: Array
) -> NDArray[np.bool_]:
    """Which values are at an edge of their range that the catalogue does not set, shape (p,)."""
    with np.errstate(invalid="ignore"):
        near = AT_EDGE * (high - low)
        below = (values <= low + near) & (low > lower)
        above = (values >= high - near) & (high < upper)
    return below | above


def needed_reach(
    values: Array, centre: Array, prior: Array, lower: Array, upper: Array
) -> NDArray[np.float64]:
    """How many times as wide as assumed ranges must be to hold values, in doublings, shape (p,)."""
    reach = np.ones(len(values))
    for _ in range(MOST_DOUBLINGS):
        low, high = assumed_range(centre, prior, lower, upper, reach)
        beyond = (values < low) | (values > high)
        if not beyond.any():
            break
        reach = np.where(beyond, 2.0 * reach, reach)
    return reach
