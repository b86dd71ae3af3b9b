"""Residuals of a model over many trials, and their sensitivity to its parameters.

All trials are simulated together, each with the parameters and with a finite difference of every
free one. Sums over residuals are made trial by trial, so that memory never holds a Jacobian of a
million rows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.estimation.logged import Logged
from pma_gym.estimation.products import Signals, products
from pma_gym.estimation.simulated_trials import SimulatedTrials
from pma_gym.integrator.equations import Interpolation
from pma_gym.plant.compiled_model import DEFAULT_TOLERANCE
from pma_gym.plant.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sums:
    """Sums over the residuals r of all trials, in units of the noise; J = dr / d(parameters).

    Attributes:
        chi_square: r.r; infinite if the model cannot be simulated.
        gradient: J^T r, shape (p,), per file unit.
        curvature: J^T J, shape (p, p).
    """

    chi_square: float
    gradient: Array
    curvature: Array


class Residuals(SimulatedTrials):
    """Residuals of measured trials against a model, for given values of its free parameters.

    A residual is simulated minus measured, in standard deviations of sensor noise and DAQ rounding.
    Simulated measurements include the sensor's lag. Missing values (NaN) are left out, and so are
    measurements at an end of the DAQ's range, which are saturated. A trial begins in equilibrium at
    its first commands. Its initial hysteresis state is fitted between 0 and 1 unless the trial
    gives it (`memory_start`); the initial position and speed of a free rig are fitted.

    The model's noise levels weigh the sensors. Arguments, further attributes and errors are those
    of `SimulatedTrials`.

    Attributes:
        count: number of residuals.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        free: Sequence[str],
        tolerance: float = DEFAULT_TOLERANCE,
        interpolation: Interpolation = "foh",
        threads: int = 1,
    ) -> None:
        super().__init__(model, trials, free, tolerance, interpolation, threads)
        self._weights = [
            [counts / width for counts, width in zip(logged.counts, self.deviations, strict=True)]
            for logged in self._trials
        ]

    def sums(self, values: Array, steps: Array, central: bool = False) -> Sums:
        """Compute the sums at parameter values, with the Jacobian by finite differences.

        Args:
            values: the parameters in file units, shape (p,).
            steps: signed step of each difference, shape (p,); or (0,) for chi-square only.
            central: use central differences, at twice the cost.
        """
        size = len(steps)
        total = np.zeros((size + 1, size + 1))

        def multiply(
            block: list[int], spaces: list[Array], zeros: Array, vectors: Array
        ) -> list[Array]:
            return self._multiplied(block, spaces, zeros, vectors, central)

        for product in self._by_block(_moved(values, steps, central), multiply):
            total += product
        widths = np.concatenate([[1.0], steps])
        total /= np.outer(widths, widths)
        if not np.isfinite(total).all() or not self._settled:
            return Sums(math.inf, np.full(size, np.nan), np.full((size, size), np.nan))
        return Sums(float(total[0, 0]), total[1:, 0], total[1:, 1:])

    def each(self, values: Array) -> list[Array]:
        """Compute the residuals of each trial, shape (rows, signals) in the order of outputs.

        Raises:
            ValueError: the model cannot balance the load at the start of a trial.
        """
        return [differences[0] for differences in self._dense(values, np.ones(0), central=False)]

    def jacobian(self, values: Array, steps: Array, central: bool = False) -> list[Array]:
        """Compute the derivatives of each trial's residuals, shape (p, rows, signals)."""
        trials = self._dense(values, steps, central)
        return [differences[1:] / steps[:, None, None] for differences in trials]

    def _dense(self, values: Array, steps: Array, central: bool) -> list[Array]:
        def copy(logged: Logged, states: Array, zeros: Array, vectors: Array) -> Array:
            dense = self._differences(logged, states, zeros, vectors, central)
            return (dense / self.deviations[:, None]).transpose(0, 2, 1)

        dense = self._each(_moved(values, steps, central), copy)
        if not self._settled:
            raise ValueError("no contraction balances the load at the beginning of a trial")
        return dense

    def _differences(
        self, logged: Logged, states: Array, zeros: Array, vectors: Array, central: bool
    ) -> Array:
        """Simulated minus measured, then what moving each parameter changes (SI).

        Shape (1 + p, signals, rows).
        """
        readings = self._held(states, zeros, vectors, logged.channels)
        count, rows = len(states), len(logged.time)
        moved = (count - 1) // 2 if central else count - 1
        differences = np.zeros((1 + moved, len(self.plant.outputs), rows))
        for channel, signal in enumerate(readings):
            if not logged.measures[channel]:
                continue
            there = differences[:, channel]
            np.subtract(signal[0], logged.measured[channel], out=there[0])
            if central:
                np.subtract(signal[1 : 1 + moved], signal[1 + moved :], out=there[1:])
                there[1:] *= 0.5
            else:
                np.subtract(signal[1:], signal[0], out=there[1:])
            if logged.missing[channel].size:
                there[:, logged.missing[channel]] = 0.0
        return differences

    def _multiplied(
        self,
        block: list[int],
        spaces: list[Array],
        zeros: Array,
        vectors: Array,
        central: bool,
    ) -> list[Array]:
        """Products of all differences with each other, in units of noise, (1 + p, 1 + p) each."""
        trials = []
        for number, states, zero in zip(block, spaces, zeros, strict=True):
            logged, weights = self._trials[number], self._weights[number]
            channels = logged.channels
            readings = self._held(states, zero, vectors, logged.channels)
            trials.append(
                Signals(
                    [readings[i] for i in channels],
                    [logged.measured[i] for i in channels],
                    [weights[i] for i in channels],
                    central,
                )
            )
        return products(trials, self.threads)


def _moved(values: Array, steps: Array, central: bool) -> Array:
    """The parameters, then with each of them moved, shape (tried, p)."""
    moves = np.diag(steps) if steps.size else np.empty((0, len(values)))
    both = [np.zeros((1, len(values))), moves, -moves]
    return values + np.concatenate(both if central else both[:2])
