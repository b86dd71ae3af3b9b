"""Voltages without feedback: what plants do under them, many at once and without noise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs import StationInfo
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.plant.plant import Plant
from pma_gym.plant.simulation import Run, simulate_all

VOLTAGE_LIMIT = 10.0
"""Largest motor voltage (V)."""


def open_loop_positions(
    plants: Sequence[Plant], station: StationInfo, volts: Sequence[NDArray[np.float64]]
) -> list[NDArray[np.float64]]:
    """True positions of trials that begin settled with no load.

    Args:
        plants: a plant for each trial, all of one structure.
        station: task, pressure and control period of all trials.
        volts: motor voltage of every control period of each trial (V), shape (steps,); what is
            beyond 0-10 V is held there.
    Returns:
        Extension (m) or rotation (rad) at k / 384 s to the last scored sample, shape (samples,),
        of each trial.
    """
    period, steps = station.period, len(volts[0])
    controlled = period * np.arange(steps + 1)
    sampled = np.arange(round(station.task.duration * SAMPLE_RATE_HZ) + 1) / SAMPLE_RATE_HZ
    # Where a command and a sample fall together but for rounding, the command's time is taken.
    near = np.abs(sampled - period * np.round(sampled / period)) < 1e-9
    sampled = np.where(near, period * np.round(sampled / period), sampled)
    time = np.union1d(controlled, sampled)
    row = np.minimum(np.searchsorted(controlled, time, side="right") - 1, steps - 1)
    rests = {id(plant): plant.settle(0.0, pressure=station.pressure) for plant in plants}
    runs = [
        Run(
            time,
            np.clip(own, 0.0, VOLTAGE_LIMIT)[row],
            np.full(len(time), plant.regulator_voltage(station.pressure)),
            "zoh",
            plant.table,
            rests[id(plant)].state,
            rests[id(plant)].zero_contraction,
        )
        for plant, own in zip(plants, volts, strict=True)
    ]
    simulate_all(plants[0].program, runs)
    kept, quantity = np.searchsorted(time, sampled), station.task.schedule.quantity
    return [
        plant.observe(run.states[kept], run.zero_contraction)[quantity].copy()
        for plant, run in zip(plants, runs, strict=True)
    ]
