"""Simulate a trial on the nominal plant beforehand, and improve its voltages."""

import numpy as np

from controllers.models.local_model import Stroke
from controllers.models.operating_range import rest_voltages
from controllers.models.voltage import VOLTAGE_LIMIT
from pma_gym.envs import StationInfo
from pma_gym.plant.plant import Plant

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


REPETITIONS = 3
"""How often voltages are nominal_rollout."""

LEARNED_SHARE = 0.7
"""Share of what an error calls for that is learned from a rollout."""

WINDOW_S = 0.2
"""Width of the window (s) over which errors are averaged: some lags of the plant."""

LEAST_LOAD_N = 5.0
"""Load (N) under which a cable may be slack, and an error tells nothing of the voltage."""


def nominal_rollout(station: StationInfo, volts: np.ndarray) -> np.ndarray:
    """What the nominal plant's sensors say at control instants under voltages, without noise.

    Args:
        station: nominal model, task, pressure, period, action delay.
        volts: actuator's voltage to be in force in every period (V), shape (steps,); held to
            0-10 V, and to where the trial begins until the first command is in force.
    Returns:
        Contraction (m) and rotation (rad) from the start, load (N), shape (3, steps + 1).
    """
    plant, (motor, regulator) = Plant(station.model), rest_voltages(station)
    moves_regulator = station.task.actuator == "regulator"
    held = np.clip(np.append(volts, volts[-1]), 0.0, VOLTAGE_LIMIT)
    held[: round(station.action_delay / station.period)] = regulator if moves_regulator else motor
    other = np.full(len(held), motor if moves_regulator else regulator)
    commands = (other, held) if moves_regulator else (held, other)
    start = plant.settle(motor, regulator_voltage=regulator)
    times = station.period * np.arange(len(held))
    states, zero = plant.run(times, *commands, interpolation="zoh", condition=start)
    said = plant.lagged(states, plant.observe(states, zero))
    measured = said[:, [plant.outputs.index(n) for n in ("contraction", "rotation", "load")]].T
    measured[:2] -= measured[:2, :1]
    return measured


def position_of(station: StationInfo, said: np.ndarray) -> np.ndarray:
    """The task's position (m or rad), shape (n,), from the result of `nominal_rollout`."""
    contraction, rotation, _ = said
    quantity = station.task.schedule.quantity
    return {"extension": -contraction, "rotation": rotation, "contraction": contraction}[quantity]


def improved(
    station: StationInfo, volts: np.ndarray, wanted: np.ndarray, stroke: Stroke
) -> np.ndarray:
    """Voltages after some rollouts, in each of which errors that stay are learned from.

        V[k] += share * mean of e / g over a window about k

    e is the plan less what the sensor says, g the static gain there. An inverse makes no error but
    for what its steps leave out, as friction's memory of a voltage that was held to a limit; of a
    few hundredths of a degree in a hold, a third is left. Where a voltage is beyond its limits, or
    the cable does not pull, it stays, and nothing is learned from there.

    Args:
        station: as of `nominal_rollout`.
        volts: to begin with (V), shape (steps,).
        wanted: planned position at control instants, as its sensor would say (m or rad), shape
            (steps + 1,).
        stroke: how the plant answers.
    """
    places = [stroke.nearest(position) for position in wanted[1:].tolist()]
    gains = np.array([stroke.models[place].gain for place in places])
    window = np.hanning(2 * round(0.5 * WINDOW_S / station.period) + 3)
    pulls = "cable" in station.model.parameters
    for _ in range(REPETITIONS):
        said = nominal_rollout(station, volts)
        error = wanted - position_of(station, said)
        possible = (volts >= 0.0) & (volts <= VOLTAGE_LIMIT)
        if pulls:
            possible &= said[2, 1:] > LEAST_LOAD_N
        called_for = np.convolve(np.where(possible, error[1:] / gains, 0.0), window, "same")
        weight = np.convolve(possible, window, "same")
        step = np.divide(called_for, weight, out=np.zeros_like(volts), where=possible)
        volts = volts + LEARNED_SHARE * step
    return volts
