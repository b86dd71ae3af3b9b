"""How episodes begin: what is drawn, and where a station stands settled."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs.options import Options, Pressure
from pma_gym.envs.record import DISTURB, DRAW
from pma_gym.kernels.random import philox, uniform
from pma_gym.plant import settle
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant, regulator_voltage
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
    words = keys.astype(np.uint64)
    stream = (episodes * 4 + DRAW).astype(np.uint64)
    nothing = np.zeros(len(episodes), np.uint64)
    shares = uniform(philox((nothing, stream, nothing, nothing), (words[:, 0], words[:, 1]))[0])
    low, high = task.starts
    found = []
    for share, one in zip(shares.tolist(), wanted, strict=True):
        if isinstance(one, str):
            found.append(low + share * (high - low))
        elif isinstance(one, Sequence):
            found.append(1e3 * float(one[int(share * len(one))]))
        else:
            found.append(1e3 * float(one))
    return np.array(found)


def drawn_events(
    task: Task, options: Options, keys: NDArray[np.int64], episodes: NDArray[np.int64]
) -> Events:
    """What disturbs episodes; arguments as `drawn_pressures`."""
    return options.disturbing.draw(task.duration, keys, episodes * 4 + DISTURB)


def holding_voltages(
    models: Sequence[Model], pressures: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Regulator voltages that settle at pressures (V), each by its own station's line.

    Raises:
        ValueError: a pressure that a regulator does not reach.
    """
    pairs = zip(models, pressures.tolist(), strict=True)
    return np.array([regulator_voltage(model, pressure) for model, pressure in pairs])


def settled_at_no_load(
    nominal: Plant,
    models: Sequence[Model],
    pressures: NDArray[np.float64],
    vectors: NDArray[np.float64] | None,
) -> Settled:
    """Stations at rest with 0 V on the motor.

    Args:
        nominal: the plant of the nominal model.
        models: each station's model.
        pressures: gauge pressures (Pa), shape (m,).
        vectors: the models' numbers, shape (m, numbers); None if all are nominal.
    """
    found = settle.at_no_load(nominal, pressures, vectors)
    if found is not None:
        return found
    conditions = []
    for model, pressure in zip(models, pressures.tolist(), strict=True):
        plant = nominal if model is nominal.model else Plant(model)
        conditions.append(plant.settle(motor_voltage=0.0, pressure=pressure))
    zero = np.array([condition.zero_contraction for condition in conditions])
    return np.array([condition.state for condition in conditions]), zero


def settled_under_load(
    nominal: Plant,
    motor: float,
    regulator: NDArray[np.float64],
    pressures: NDArray[np.float64],
    vectors: NDArray[np.float64] | None,
) -> Settled:
    """Stations at rest under the load that the motor holds.

    Args:
        nominal: the plant of the nominal model.
        motor: motor voltage (V).
        regulator: regulator voltages (V), shape (m,).
        pressures: gauge pressures that they hold (Pa), shape (m,).
        vectors: the models' numbers, shape (m, numbers); None if all are nominal.
    Raises:
        ValueError: no contraction balances the load.
    """
    states, zero = settle.all_at_rest(nominal, np.full(len(regulator), motor), regulator, vectors)
    lost = np.flatnonzero(np.isnan(states).any(axis=1) | np.isnan(zero))
    if len(lost):
        raise ValueError(
            f"no contraction of model {nominal.model.name} balances the load that the motor holds "
            f"with {motor:.4g} V at {pressures[lost[0]] / 1e3:.4g} kPa; give a higher pressure_kpa "
            "or a task of less load"
        )
    return states, zero
