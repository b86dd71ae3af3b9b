"""Static muscle forces and contractions for arrays of pressures and loads."""

from collections.abc import Callable

import numpy as np

from pma_gym.codegen.trace import as_numpy
from pma_gym.effects.effect import signals
from pma_gym.plant.model import Model

_HALVINGS = 48
"""Bisections of a 120 mm bracket, to below 1e-12 mm."""


def muscle_force(model: Model) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Static force of a model's muscle, with all effects' states at zero.

    Args:
        model: a station's model.
    Returns:
        Function of pressure (Pa) and contraction (m), arrays of one shape, that returns the force
        (N), positive when it shortens the muscle.
    """
    laws = []
    for effect in model.effects.values():
        if effect.port == "muscle_force" and effect.law and "memory" not in signals(effect.law):
            names = signals(effect.law)
            laws.append((as_numpy(effect.law), names, model.parameters[effect.name]))

    def force(pressure: np.ndarray, contraction: np.ndarray) -> np.ndarray:
        total = np.zeros(np.broadcast(pressure, contraction).shape)
        known = {"pressure": pressure, "contraction": contraction, "velocity": 0.0 * total}
        for law, names, parameters in laws:
            total = total + law(*(parameters if n == "p" else known[n] for n in names))
        return total

    return force


def contraction_at(
    force: Callable[[np.ndarray, np.ndarray], np.ndarray],
    pressure: np.ndarray,
    load: np.ndarray,
    shortest: float = -0.03,
    longest: float = 0.09,
) -> np.ndarray:
    """Find the contraction at which a force law balances a load, by bisection.

    Args:
        force: function of pressure (Pa) and contraction (m) giving N; falls with contraction.
        pressure: gauge pressures (Pa), shape (n,).
        load: loads (N), shape (n,).
        shortest: lower end of the search (m).
        longest: upper end (m).
    Returns:
        Contraction (m), shape (n,); an end of the search where the law never balances the load.
    """
    shape = np.broadcast(pressure, load).shape
    low, high = np.full(shape, shortest), np.full(shape, longest)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        pulls = force(pressure, middle) > load
        low, high = np.where(pulls, middle, low), np.where(pulls, high, middle)
    return 0.5 * (low + high)
