"""scipy's integrators on the station, its right-hand side compiled."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.speed.loops import Prepared
from benchmarks.speed.workers.same_plant import PERIOD, mean, prepared, rate, voltages

PACKAGES = ("scipy", "numpy")


def held(method: str, rtol: float) -> Prepared:
    """Commands held for a control step each, solve_ivp called for every one.

    Args:
        method: one of solve_ivp's.
        rtol: relative tolerance; the absolute one is a thousandth of it.
    """
    rates: dict[float, Callable] = {motor: rate(motor) for motor in voltages()}
    counts: list[int] = []

    def integrate(state: NDArray[np.float64], motor: float) -> NDArray[np.float64]:
        span = solve_ivp(rates[motor], (0.0, PERIOD), state, method, rtol=rtol, atol=1e-3 * rtol)
        counts.append(span.nfev)
        return span.y[:, -1]

    return prepared(integrate, 10, lambda: mean(counts))


ROWS = {"held": held}
