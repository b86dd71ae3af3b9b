"""The nominal plant of a whole trial as one matrix, and its inverse up to a frequency.

All steps of a trial make one vector: y = G v, G the local model in force at each step,

    y(k) = -a_1 y(k-1) - ... - a_n y(k-n) + b_1 v(k-1) + ... + b_n v(k-n),   y = A^-1 B v

with banded matrices A and B. The change d of the voltages that an error o asks for is

    argmin |o - G d|^2 + rho |D2 d|^2,   D2 the second difference

With d = A s, and G d = B s as long as models change slowly along the trial, the normal equations in
s are banded too, and their solution takes some milliseconds. d is the inverse of G behind a
low-pass without phase: for one frequency |G|^2 / (|G|^2 + rho |D2|^2).

Source:
    D. A. Bristow, M. Tharayil and A. G. Alleyne 2006, "A survey of iterative learning control",
    IEEE Control Systems Magazine 26(3), the lifted form and quadratic design.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import spsolve

from controllers.models.nominal_motion import NominalMotion

HOLD = 1e-4
"""Cost of a change of voltage, relative to the cost of the error that it corrects."""

LOOSE = 1.0
"""The same while the cable is slack."""


class LiftedModel:
    """G of the voltages sent in a trial's steps.

    Args:
        motion: the nominal motion.
        late: after how many steps a voltage is in force and its effect measured.
        count: number of steps.
    """

    def __init__(self, motion: NominalMotion, late: int, count: int) -> None:
        self._period, self._count = motion.station.period, count
        times = self._period * np.arange(late, late + count)
        models = [motion.local(motion.expected(time)) for time in times.tolist()]
        back = range(1, len(models[0].b) + 1)
        below = [-k for k in back]
        a, b = np.array([-one.a[:, 0] for one in models]), np.array([one.b for one in models])
        square = count, count
        self._a = banded([np.ones(count), *(a[k:, k - 1] for k in back)], [0, *below], square)
        self._b = banded([b[k:, k - 1] for k in back], below, square)
        middle = models[count // 2]
        self._static, self._lag = middle.gain, middle.time_constant

    def response(self, voltage: np.ndarray) -> np.ndarray:
        """G v (m or rad), shape (count,)."""
        return self._b @ spsolve(self._a, voltage)

    def change(self, error: np.ndarray, taut: np.ndarray, cutoff: float) -> np.ndarray:
        """The change of voltage (V) that would take an error away, up to a frequency.

        Args:
            error: shape (count,).
            taut: which steps say something, shape (count,).
            cutoff: where |G|^2 = rho |D2|^2, so that half is learned (Hz).
        """
        corner = 2.0 * math.pi * cutoff
        rough = 1.0 / ((corner * self._period) ** 4 * (1.0 + (corner * self._lag) ** 2))
        seen = sparse.diags_array(taut.astype(float) / self._static)
        second = second_difference(self._count)
        near = sparse.diags_array((taut[:-2] & taut[1:-1] & taut[2:]).astype(float))
        price = near @ second @ self._a * math.sqrt(rough)
        held = sparse.diags_array(np.sqrt(np.where(taut, HOLD, LOOSE))) @ self._a
        effect = seen @ self._b
        normal = effect.T @ effect + price.T @ price + held.T @ held
        return self._a @ spsolve(normal.tocsc(), effect.T @ (seen @ error))


def second_difference(count: int) -> sparse.csc_array:
    """D2 of so many steps, sparse, shape (count - 2, count)."""
    return banded([1.0, -2.0, 1.0], [0, 1, 2], (count - 2, count))


def banded(
    diagonals: Sequence[ArrayLike], offsets: Sequence[int], shape: tuple[int, int]
) -> sparse.csc_array:
    """A sparse matrix of diagonals, each with its offset from the main one."""
    matrix = sparse.diags_array(diagonals, offsets=offsets, shape=shape)  # type: ignore[arg-type]
    return matrix.tocsc()
