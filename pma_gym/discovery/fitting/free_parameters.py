"""Parameters first: which of a model's own numbers may be off, by how much, and what they become.

A law that the model has at its neutral value is an effect, not a parameter, and so are the errors
of its sensors. What is left is refitted, here and again beside every candidate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.thresholds import CONFIDENCE, PRIOR_LEAST, PRIOR_SHARE, PRIOR_WIDER
from pma_gym.effects import CATALOGUE
from pma_gym.plant import sensors
from pma_gym.plant.model import Model

Array = NDArray[np.float64]

AT_LIMIT = 1e-6
"""Distance from an end of a range, as a share of the range, within which a value is at that end."""

BOUNDLESS = 1e3
"""Times the lower end of a positive range that count for its width, where it is wider."""


@dataclass(frozen=True)
class FreeParameters:
    """A model's own parameters.

    Attributes:
        free: paths of those that may be off.
        prior: standard deviations about the model's values, in file units, shape (p,).
    """

    free: tuple[str, ...]
    prior: Array


def free_parameters(model: Model) -> FreeParameters:
    """Which parameters of a model may be off, and by how much."""
    free = tuple(path for path in model.paths() if _is_own(model, path))
    return FreeParameters(free, np.array([prior(model, path) for path in free]))


def prior(model: Model, path: str) -> float:
    """Standard deviation of a parameter about the model's value, in file units."""
    effect, _, file_key = path.partition(".")
    law = CATALOGUE[effect]
    value = model.values_in_files(effect)[file_key]
    assert isinstance(value, float | int)
    unit = law.quantities[law.names_in_files()[file_key]].unit
    usual = max(PRIOR_SHARE * abs(value), PRIOR_LEAST.get(unit, 0.0))
    note = model.notes.get(path)
    if note is not None and note.low is not None and note.high is not None:
        usual = max(usual, PRIOR_WIDER * (note.high - note.low) / (2.0 * CONFIDENCE))
    return usual if usual > 0.0 else PRIOR_SHARE


def values(model: Model, paths: Sequence[str]) -> Array:
    """Values of parameters in file units."""
    numbers = []
    for path in paths:
        effect, _, file_key = path.partition(".")
        numbers.append(model.values_in_files(effect)[file_key])
    return np.array(numbers, float)


def at_limit(value: float, lower: float, upper: float) -> str:
    """Which end of its range a value is at: `lower`, `upper`, or none: empty."""
    reach = AT_LIMIT * (upper - lower)
    if value >= upper - reach:
        return "upper"
    # An upper end that is never reached says nothing of how near the lower one is.
    least = min(reach, BOUNDLESS * AT_LIMIT * lower) if lower > 0.0 else reach
    return "lower" if value <= lower + least else ""


def unit(path: str) -> str:
    """File unit of a parameter."""
    effect, _, file_key = path.partition(".")
    law = CATALOGUE[effect]
    return law.quantities[law.names_in_files()[file_key]].unit


def _is_own(model: Model, path: str) -> bool:
    effect, _, file_key = path.partition(".")
    law = CATALOGUE[effect]
    stem = law.names_in_files()[file_key]
    if law.port == "part" and effect in ("limits", "validity"):
        return False
    if stem in law.rows or stem in law.held or effect in sensors.SENSORS:
        return False
    if effect == "drive" and "hanging_load" in model.parameters:
        # Weights have been weighed.
        return False
    if effect.endswith("_error"):
        return False
    quantity, value = law.quantities[stem], getattr(model.parameters[effect], stem)
    return not (quantity.neutral is not None and value == quantity.to_si(quantity.neutral))
