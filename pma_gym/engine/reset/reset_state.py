"""Initial states of episodes: random draws and equilibria."""

from collections.abc import Sequence
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.random import philox, uniform
from pma_gym.engine.option_checks import Pressure
from pma_gym.engine.options import Options
from pma_gym.engine.state_layout import DISTURB, DRAW
from pma_gym.plant.compiled_model import regulator_voltage
from pma_gym.plant.equilibrium import solver
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import Program
from pma_gym.tasks import Events, Task

Settled = tuple[NDArray[np.float64], NDArray[np.float64]]
"""State vectors, shape (m, states), and contractions at no load (m), shape (m,)."""


def drawn_pressures(
    task: Task, keys: NDArray[np.int64], episodes: NDArray[np.int64], wanted: Sequence[Pressure]
) -> NDArray[np.float64]:
    """Gauge pressures of episodes (Pa).

    Args:
        task: the task.
        keys: two words of random numbers for each environment, shape (m, 2).
        episodes: numbers of the episodes, shape (m,).
        wanted: as the option `pressure_kpa`, one each.
    """
    low, high = task.starts
    pressures = []
    for share, one in zip(_shares(keys, episodes * 4 + DRAW), wanted, strict=True):
        if isinstance(one, str):
            pressures.append(low + share * (high - low))
        elif isinstance(one, Sequence):
            pressures.append(1e3 * float(one[int(share * len(one))]))
        else:
            pressures.append(1e3 * float(one))
    return np.array(pressures)


def _shares(keys: NDArray[np.int64], streams: NDArray[np.int64]) -> list[float]:
    """A number between 0 and 1 for each key and stream."""
    if len(streams) <= FEW:
        pairs = zip(streams.tolist(), keys.tolist(), strict=True)
        return [uniform(philox((0, stream, 0, 0), tuple(key))[0]) for stream, key in pairs]
    words, counter = keys.astype(np.uint64), streams.astype(np.uint64)
    nothing = np.zeros(len(streams), np.uint64)
    drawn = philox((nothing, counter, nothing, nothing), (words[:, 0], words[:, 1]))
    return uniform(drawn[0]).tolist()


FEW = 8
"""Environments whose numbers are drawn faster one by one than as an array, of the same bits."""


def drawn_events(
    task: Task, options: Options, keys: NDArray[np.int64], episodes: NDArray[np.int64]
) -> Events:
    """Draw the disturbances of episodes; arguments as `drawn_pressures`."""
    return options.disturbing.draw(task.duration, keys, episodes * 4 + DISTURB)


def holding_voltages(
    models: Sequence[Model], pressures: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Regulator voltages for steady pressures (V), each by its station's calibration line.

    Raises:
        ValueError: a pressure that a regulator does not reach.
    """
    pairs = zip(models, pressures.tolist(), strict=True)
    return np.array([regulator_voltage(model, pressure) for model, pressure in pairs])


KEPT = 4096
"""Size of the cache of equilibria: training on drawn stations meets each of them repeatedly."""

_KEEPING = Lock()
_KEPT: dict[tuple[Program, bytes, float], tuple[NDArray[np.float64], float]] = {}


def settled_at_no_load(
    rest: solver.NoLoadEquilibria,
    models: Sequence[Model],
    pressures: NDArray[np.float64],
    regulator: NDArray[np.float64],
    vectors: NDArray[np.float64] | None,
) -> Settled:
    """Find the equilibria of stations with 0 V at the motor.

    Args:
        rest: finds stations of the nominal plant at rest.
        models: each station's model.
        pressures: gauge pressures (Pa), shape (m,).
        regulator: regulator voltages that hold them (V), shape (m,).
        vectors: the models' numbers, shape (m, numbers); None if all are nominal.
    Raises:
        ValueError: no contraction balances the drive's load.
    """
    slack = rest(pressures, vectors)
    if slack is not None:
        return slack
    nominal = rest.plant
    numbers = np.tile(nominal.vector, (len(models), 1)) if vectors is None else vectors
    keys = [
        (nominal.program, row.tobytes(), volts)
        for row, volts in zip(numbers, regulator.tolist(), strict=True)
    ]
    # By what a rest depends on. Those that are asked for twice at once are searched for once.
    # Others may drop what was there a moment ago: what is there is taken once.
    rests = {key: kept for key in keys if (kept := _KEPT.get(key)) is not None}
    new = {key: i for i, key in enumerate(keys) if key not in rests}
    fresh: dict[tuple[Program, bytes, float], tuple[NDArray[np.float64], float]] = {}
    if new:
        at = list(new.values())
        rested = solver.equilibria_at(nominal, np.zeros(len(at)), regulator[at], numbers[at])
        fresh = dict(zip(new, zip(*rested, strict=True), strict=True))
    for key, (state, zero) in fresh.items():
        if np.isnan(zero) or np.isnan(state).any():
            # Says what does not balance.
            Plant(models[new[key]]).settle(motor_voltage=0.0, regulator_voltage=key[2])
    with _KEEPING:
        _KEPT.update(fresh)
        for key in list(_KEPT)[: max(len(_KEPT) - KEPT, 0)]:
            del _KEPT[key]
    rests |= fresh
    states, zeros = zip(*(rests[key] for key in keys), strict=True)
    return np.array(states), np.array(zeros)


def hangs_slack(rest: solver.NoLoadEquilibria, low: float, high: float) -> bool:
    """Whether the cable hangs slack at 0 V, and muscles balance, at all pressures of a range.

    Args:
        rest: finds stations at rest.
        low: lowest gauge pressure (Pa).
        high: highest.
    """
    return rest(np.linspace(low, high, LOOKED_AT)) is not None


LOOKED_AT = 64
"""Pressures of a range at which a balance is looked for."""


def settled_under_load(
    nominal: Plant,
    motor: float,
    regulator: NDArray[np.float64],
    pressures: NDArray[np.float64],
    vectors: NDArray[np.float64] | None,
) -> Settled:
    """Find the equilibria of stations under the motor's load.

    Args:
        nominal: the plant of the nominal model.
        motor: motor voltage (V).
        regulator: regulator voltages (V), shape (m,).
        pressures: gauge pressures that they hold (Pa), shape (m,).
        vectors: the models' numbers, shape (m, numbers); None if all are nominal.
    Raises:
        ValueError: no contraction balances the load.
    """
    states, zero = solver.equilibria_at(nominal, np.full(len(regulator), motor), regulator, vectors)
    lost = np.flatnonzero(np.isnan(states).any(axis=1) | np.isnan(zero))
    if len(lost):
        raise ValueError(
            f"no contraction of model {nominal.model.name} balances the load that the motor holds "
            f"with {motor:.4g} V at {pressures[lost[0]] / 1e3:.4g} kPa; give a higher pressure_kpa "
            "or a task of less load"
        )
    return states, zero
