"""A candidate: an effect that a model may lack, ready to be fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import Model
from pma_gym.units import TURN_DEG, Quantity

Array = NDArray[np.float64]


ABSENT = 1e-6
"""Share of the largest size that is looked for, at or below which a size is none."""


@dataclass(frozen=True)
class CandidateEffect:
    """One effect that may be missing.

    Attributes:
        name: its name in the diagnosis.
        effect: its effect's name in the catalogue.
        model: the model with the effect where it does nothing.
        paths: the parameters that make it what it is.
        fitted: which of them are fitted with it, shape (p,); the others only switch it on.
        absent: their values where it does nothing, in file units, shape (p,).
        probes: values at which it is looked for, shape (n, p).
        amplitudes: which of them scale with the size of the effect, shape (p,).
        signs: for each probe, whether the opposite makes sense too.
        own: values (SI) that a parameter has in each trial, by path.
        left: paths that left the law because the trials do not determine them (`nested_laws`).
        lowest: least values (file unit) that trials of this way can show, by path, where those are
            above what the catalogue allows.
        highest: largest values, likewise, where those are below what the catalogue allows.
    """

    name: str
    effect: str
    model: Model
    paths: tuple[str, ...]
    fitted: NDArray[np.bool_]
    absent: Array
    probes: Array
    amplitudes: NDArray[np.bool_]
    signs: NDArray[np.bool_]
    own: Mapping[str, Sequence[float]] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    lowest: Mapping[str, float] = field(default_factory=dict)
    highest: Mapping[str, float] = field(default_factory=dict)

    @property
    def fitted_paths(self) -> list[str]:
        """Paths of the parameters that are fitted."""
        pairs = zip(self.paths, self.fitted, strict=True)
        return [path for path, free in pairs if free and path not in self.left]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest values of `paths` in file units, shape (p,) each."""
        lower, upper = bounds(self.paths)
        least = [self.lowest.get(path, -np.inf) for path in self.paths]
        most = [self.highest.get(path, np.inf) for path in self.paths]
        return np.maximum(lower, least), np.minimum(upper, most)

    def is_absent(self, model: Model) -> bool:
        """Whether a model has this effect with every size where it does nothing."""
        here = np.array(
            [model.values_in_files(self.effect)[path.partition(".")[2]] for path in self.paths]
        )
        reach = np.abs(self.probes - self.absent).max(axis=0)
        # A time has no value at which it does nothing.
        neutral = np.array([_quantity(path).neutral is not None for path in self.paths])
        sizes = self.amplitudes & neutral & (reach > 0.0)
        near = np.abs(here - self.absent) <= ABSENT * reach
        return bool(sizes.any() and near[sizes].all())

    def beside(self, model: Model) -> Model:
        """Another model with this effect where it does nothing."""
        if self.effect in model.parameters:
            return model
        table = self.model.values_in_files(self.effect)
        return model.with_effects({self.effect: table})

    def grown(self, probe: int, factor: float) -> Array:
        """A probe whose effect is so many times as large, within bounds."""
        chosen = self.probes[probe].copy()
        # A time of an effect without another size counts from 0.
        origin = self.absent if self.fitted.all() else np.zeros_like(self.absent)
        scaled = origin + factor * (chosen - origin)
        chosen[self.amplitudes] = scaled[self.amplitudes]
        for at, path in enumerate(self.paths):
            if factor < 0.0 and path.endswith(".phase_deg"):
                # The opposite of a wave is the wave half a period later.
                chosen[at] += 180.0 if chosen[at] <= 0.0 else -180.0
                chosen[self.amplitudes] = -scaled[self.amplitudes]
        return np.clip(chosen, *self.bounds)


def bounds(paths: Sequence[str]) -> tuple[Array, Array]:
    """Bounds of parameters in file units."""
    quantities = [_quantity(path) for path in paths]
    return (
        np.array([quantity.lower for quantity in quantities], float),
        np.array([quantity.upper for quantity in quantities], float),
    )


def within_turn(paths: Sequence[str], values: Array) -> Array:
    """Values in file units, with angles that a whole turn does not change within half a turn."""
    turning = np.array([_quantity(path).turns for path in paths], bool)
    return np.where(turning, values - TURN_DEG * np.round(values / TURN_DEG), values)


def _quantity(path: str) -> Quantity:
    effect, _, file_key = path.partition(".")
    law = CATALOGUE[effect]
    return law.quantities[law.names_in_files()[file_key]]
