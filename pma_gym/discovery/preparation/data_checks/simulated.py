"""Trials beside the given model's simulation of their commands, as the checks compare them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant

Array = NDArray[np.float64]

ATMOSPHERE = 101.325e3
"""Standard pressure of the air (Pa)."""


@dataclass(frozen=True)
class Pair:
    """A measured trial beside its simulation.

    Attributes:
        number: which trial it is.
        trial: as measured.
        simulated: what the given model's sensors would read, without noise.
    """

    number: int
    trial: Trial
    simulated: Trial

    def signal(self, quantity: str) -> tuple[Array, Array, Array]:
        """Times, simulated and measured values of a signal where it was measured; may be empty."""
        measured = self.trial.measurements.get(quantity)
        if measured is None or quantity not in self.simulated.measurements:
            return np.empty(0), np.empty(0), np.empty(0)
        there = np.isfinite(measured)
        return self.trial.time[there], self.simulated.measurements[quantity][there], measured[there]


def pairs(
    model: Model,
    trials: Sequence[Trial],
    corrected: Callable[[Array], Array] | None = None,
) -> list[Pair]:
    """The trials that the model can simulate, beside its simulations.

    Args:
        model: the given model, a station.
        trials: the trials.
        corrected: makes of commanded pressures what they should be (Pa); None where they are right.
    """
    plant = Plant(model)
    every = []
    for number, trial in enumerate(trials):
        try:
            simulated = plant.simulate(_with_pressure(trial, corrected), noise=False)
        # Commands that the model cannot follow: its own fit says so, in its own words.
        except ValueError:
            continue
        if all(np.isfinite(values).all() for values in simulated.measurements.values()):
            every.append(Pair(number, trial, simulated))
    return every


def _with_pressure(trial: Trial, corrected: Callable[[Array], Array] | None) -> Trial:
    commanded = trial.commands.get("pressure_command")
    if corrected is None or commanded is None:
        return trial
    return replace(trial, commands={**trial.commands, "pressure_command": corrected(commanded)})
