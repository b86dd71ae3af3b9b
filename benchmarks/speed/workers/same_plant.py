"""The station itself under commands held for 10 ms each, for others' integrators to run.

No sensors' noise, no reward, no Gymnasium: the comparison is one of integrators.
"""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.speed.loops import EPISODE, Prepared
from pma_gym.plant.condition import Condition
from pma_gym.plant.plant import Plant

PERIOD = 0.01
"""How long a command is held (s)."""

PRESSURE = 350e3
"""Gauge pressure of the trial (Pa)."""

CHECKED = 50
"""Control steps that the error is taken over."""

Integrate = Callable[[NDArray[np.float64], float], NDArray[np.float64]]
"""State after a period, from the state and the motor voltage (V)."""


@cache
def plant() -> Plant:
    """The station."""
    return Plant("station")


def voltages() -> list[float]:
    """Motor voltages of a trial (V): what random actions are in the environments."""
    return np.random.default_rng(0).uniform(0.0, 10.0, EPISODE).tolist()


def rate(motor: float) -> Callable[[float, NDArray[np.float64]], NDArray[np.float64]]:
    """The right-hand side while a motor voltage (V) is held."""
    station, rest = plant(), plant().settle(0.0, PRESSURE)
    regulator, zero = station.regulator_voltage(PRESSURE), rest.zero_contraction
    return lambda _, state: station.derivative(state, motor, regulator, zero)


def prepared(integrate: Integrate, chunk: int, evaluations: Callable[[], float]) -> Prepared:
    """A row of an integrator on the trial.

    Args:
        integrate: one control step.
        chunk: control steps at a time.
        evaluations: right-hand sides of a control step so far; NaN if it cannot be told.
    """
    start = plant().settle(0.0, PRESSURE).state
    commands, state, at = voltages(), start, 0
    error = position_error(integrate)

    def steps() -> int:
        nonlocal state, at
        for _ in range(chunk):
            if at == len(commands):
                state, at = start, 0
            state = integrate(state, commands[at])
            at += 1
        return chunk

    def facts() -> dict[str, float]:
        count = evaluations()
        counts = {} if np.isnan(count) else {"right_hand_sides": count}
        return {"position_error": error} | counts

    return Prepared(steps, facts)


def position_error(integrate: Integrate) -> float:
    """Largest error of the contraction over the first steps, as a share of its range there."""
    state = truth = plant().settle(0.0, PRESSURE).state
    at, errors = plant().states.index("contraction"), []
    for motor in voltages()[:CHECKED]:
        state = integrate(state, motor)
        truth = _exact(truth, motor)
        errors.append((state[at], truth[at]))
    values = np.array(errors)
    return float(np.abs(values[:, 0] - values[:, 1]).max() / np.ptp(values[:, 1]))


@cache
def _tight() -> Plant:
    return Plant("station", 1e-8)


def _exact(state: NDArray[np.float64], motor: float) -> NDArray[np.float64]:
    """By this package's integrator at a tight tolerance, which `accuracy` holds against scipy."""
    station = _tight()
    zero = plant().settle(0.0, PRESSURE).zero_contraction
    condition = Condition(state.copy(), zero)
    station.step(condition, motor, station.regulator_voltage(PRESSURE), PERIOD)
    return condition.state


def mean(counts: Sequence[int]) -> float:
    """Mean of some counts; NaN of none."""
    return sum(counts) / len(counts) if counts else float("nan")
