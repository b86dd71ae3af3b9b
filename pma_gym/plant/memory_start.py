"""Where memories stand when a trial begins: as the model says, as the trial says, or fitted.

A muscle that was filled and has contracted stands on one branch of its hysteresis, one that was
stretched before stands on another, and no log says which. So a fit leaves the start of a memory
free in every trial, between 0 (no way remembered) and 1 (filled and contracted): every trial is
simulated once more with another start, and each simulation is moved along the difference to where
it meets the readings best. Hysteresis is linear in its memory at the start as long as the motion
is the same, so the difference holds from one end to the other.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.trial import Trial
from pma_gym.data.trial_checks import check_memory_at_start
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

PRIOR = (0.0, 1.0)
"""Between which a memory of a measured trial begins, each value as likely as the other."""

MIDDLE, MOVE = 0.5, 0.25
"""Where measured trials are simulated from, and how much further once more."""


def memory_starts(model: Model) -> tuple[str, ...]:
    """Paths of the parameters that say where memories begin, `effect.parameter`."""
    return tuple(dict.fromkeys(memory_states(model).values()))


def memory_states(model: Model) -> dict[str, str]:
    """The same paths, by the state that begins there."""
    return {
        state: f"{name}.{door}"
        for name, effect in model.effects.items()
        for door, stem in effect.names_at_the_door().items()
        if stem == effect.memory_start
        for state in effect.memory_names
    }


def memory_at_start(model: Model) -> float | None:
    """Where a model's trials begin; None for a model that has nothing to begin with.

    >>> from pma_gym.plant.model import load_model
    >>> memory_at_start(load_model("serres2008")) is None
    True
    """
    for name, effect in model.effects.items():
        if effect.memory_start:
            return float(getattr(model.parameters[name], effect.memory_start))
    return None


def begun_at(model: Model, memory_at_start: float | None) -> Model:
    """A model whose trials begin with their memories at a value.

    Args:
        model: the model.
        memory_at_start: -1 to 1; 1: the muscle was filled and has contracted; None: as the model
            says.
    Raises:
        TrialError: a value that no memory has. A model without hysteresis takes any other and
            stays as it is: it has nothing to begin with.
    """
    if memory_at_start is None:
        return model
    check_memory_at_start(memory_at_start, f"model {model.name}")
    return model.replace(dict.fromkeys(memory_starts(model), float(memory_at_start)))


def first_guesses(trials: Sequence[Trial]) -> Array:
    """Where memories begin in simulations of trials: as a trial says, else in the middle."""
    given = [trial.memory_at_start for trial in trials]
    return np.array([MIDDLE if one is None else one for one in given], float)


def reach(trial: Trial) -> tuple[float, float]:
    """How far a trial's simulation may be moved, in moves; no way where the trial says it."""
    if trial.memory_at_start is not None:
        return 0.0, 0.0
    low, high = PRIOR
    return (low - MIDDLE) / MOVE, (high - MIDDLE) / MOVE


def best_shares(left: Array, along: Array, ends: tuple[float, float]) -> Array:
    """How many moves bring each simulation nearest to the readings.

    Args:
        left: what each leaves, simulated less measured in units of noise, shape (tried, n).
        along: what one move changes, in the same units, shape (n,).
        ends: least and most moves.
    Returns:
        Shape (tried,); 0 where a move changes nothing.
    """
    size = float(along @ along)
    if not np.isfinite(size) or size == 0.0:
        return np.zeros(len(left))
    return np.clip(-(left @ along) / size, *ends)
