"""Initial hysteresis state of a trial: from the model, from the trial, or fitted.

After filling and contracting, a muscle is on one branch of its hysteresis; after a stretch it is on
another. Logs do not record the branch. A fit therefore estimates the initial state of every trial,
between 0 (no history) and 1 (filled and contracted): it simulates every trial a second time with
another initial state and interpolates between both simulations to fit the measurements. For equal
motion, hysteresis is linear in its initial state, so the interpolation is valid over the range.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.data.trial_checks import check_memory_at_start
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

PRIOR = (0.0, 1.0)
"""Range of the initial state of a measured trial, with a uniform prior."""

MIDDLE, MOVE = 0.5, 0.25
"""Initial state of the first simulation of a measured trial, and its change for the second."""


def memory_starts(model: Model) -> tuple[str, ...]:
    """Paths of the parameters that give initial states of effects, `effect.parameter`."""
    return tuple(dict.fromkeys(memory_states(model).values()))


def memory_states(model: Model) -> dict[str, str]:
    """Paths of the parameters that give initial states, keyed by the state."""
    return {
        state: f"{name}.{file_key}"
        for name, effect in model.effects.items()
        for file_key, stem in effect.names_in_files().items()
        if stem == effect.memory_start
        for state in effect.memory_names
    }


def memory_at_start(model: Model) -> float | None:
    """Initial hysteresis state of a model's trials; None for a model without such a state.

    >>> from pma_gym.plant.model import load_model
    >>> memory_at_start(load_model("serres2008")) is None
    True
    """
    for name, effect in model.effects.items():
        if effect.memory_start:
            return float(getattr(model.parameters[name], effect.memory_start))
    return None


def begun_at(model: Model, memory_at_start: float | None) -> Model:
    """Return the model with another initial hysteresis state.

    Args:
        model: the model; a model without hysteresis is returned unchanged.
        memory_at_start: -1 to 1, where 1 is a muscle that was filled and has contracted; None keeps
            the model's value.
    Raises:
        TrialError: a value out of range.
    """
    if memory_at_start is None:
        return model
    check_memory_at_start(memory_at_start, f"model {model.name}")
    return model.replace(dict.fromkeys(memory_starts(model), float(memory_at_start)))


def first_guesses(trials: Sequence[Trial]) -> Array:
    """Initial states for simulations of trials: from the trial, else the middle of the range."""
    stated = [trial.memory_at_start for trial in trials]
    return np.array([MIDDLE if one is None else one for one in stated], float)


def reach(trial: Trial) -> tuple[float, float]:
    """Range of the interpolation between two simulations; empty if the trial gives the state."""
    if trial.memory_at_start is not None:
        return 0.0, 0.0
    low, high = PRIOR
    return (low - MIDDLE) / MOVE, (high - MIDDLE) / MOVE


def best_shares(left: Array, along: Array, ends: tuple[float, float]) -> Array:
    """Find the shares of the second simulation that fit the measurements best.

    Args:
        left: residuals, simulated minus measured in units of noise, shape (tried, n).
        along: change of the residuals by the full difference, in the same units, shape (n,).
        ends: smallest and largest share.
    Returns:
        Shape (tried,); 0 where the difference has no effect.
    """
    size = float(along @ along)
    if not np.isfinite(size) or size == 0.0:
        return np.zeros(len(left))
    return np.clip(-(left @ along) / size, *ends)
