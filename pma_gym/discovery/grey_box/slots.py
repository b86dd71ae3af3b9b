"""Slots of parameters, `effect.parameter`: paths in files, units, coordinates of a fit."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.discovery.fitting.free_parameters import free_parameters, prior
from pma_gym.effects import CATALOGUE
from pma_gym.estimation.innovations import TREND, TRIAL, GreyBox
from pma_gym.estimation.likelihood_fit import Coordinate
from pma_gym.plant.model import Model
from pma_gym.units import Quantity

Array = NDArray[np.float64]

WIDE = 5.0
"""Standard deviation of the own parameters' priors.

In those that the parameters' list has (10 % of them).
"""


def slot(path: str) -> str:
    """`effect.parameter` of a path."""
    effect, _, key = path.partition(".")
    return f"{effect}.{CATALOGUE[effect].names_in_files()[key]}"


def path_of(name: str) -> str:
    """Path of a slot: with its file unit."""
    effect, _, stem = name.partition(".")
    keys = {own: key for key, own in CATALOGUE[effect].names_in_files().items()}
    return f"{effect}.{keys[stem]}"


def quantity_of(name: str) -> Quantity:
    """Unit and bounds of a slot's parameter."""
    effect, _, stem = name.partition(".")
    return CATALOGUE[effect].quantities[stem]


def values_of(paths: Sequence[str], row: Array) -> dict[str, float]:
    """Values (SI) by slot of values in file units."""
    return {
        slot(path): quantity_of(slot(path)).to_si(float(value))
        for path, value in zip(paths, row, strict=True)
    }


def with_numbers(model: Model, numbers: Mapping[str, float]) -> Model:
    """A model with fitted numbers (SI) by slot; those of one trial alone are none of it."""
    changes = {}
    for name, value in numbers.items():
        effect, _, stem = name.partition(".")
        if stem in model.effects[effect].rows or TREND in stem or TRIAL in stem or "[" in stem:
            continue
        if value != getattr(model.parameters[effect], stem):
            quantity = CATALOGUE[effect].quantities[stem]
            # A bound in SI and back may be a bit beyond itself.
            changes[path_of(name)] = float(
                np.clip(quantity.from_si(value), quantity.lower, quantity.upper)
            )
    return model.replace(changes)


def gains_of_drive(model: Model) -> list[str]:
    """Slots of the drive's gain, which one trial cannot tell from the inertia.

    But several can from each other.
    """
    drives = [e for e in model.effects.values() if e.port == model.rig.drive_port]
    return [
        f"{e.name}.{stem}"
        for e in drives
        for stem in e.quantities
        if stem in ("gain", "torque_constant")
    ]


def own_coordinates(box: GreyBox) -> tuple[list[Coordinate], dict[str, str]]:
    """Coordinates of the model's own parameters, and slots that follow another one."""
    model, numbers = box.model, box.numbers()
    coordinates, tied = list[Coordinate](), dict[str, str]()
    for path in free_parameters(model).free:
        name, quantity = slot(path), quantity_of(slot(path))
        effect, _, stem = name.partition(".")
        law = model.effects[effect]
        if path in model.rig.start_paths.values() or quantity.unit.endswith("/kPa"):
            continue
        tie = next((t for t in law.ties if stem in t[1:]), None)
        if tie and numbers[f"{effect}.{tie[0]}"] == numbers[f"{effect}.{tie[1]}"]:
            tied |= {name: f"{effect}.{tie[0]}"} if stem == tie[1] else {}
            continue
        spread = WIDE * abs(quantity.to_si(prior(model, path)) - quantity.to_si(0.0))
        inertial = tuple(name.split(".")) == model.rig.inertia
        scale = 1.0 if inertial else abs(numbers[name]) or spread
        lower, upper = quantity.to_si(quantity.lower), quantity.to_si(quantity.upper)
        coordinates.append(
            Coordinate(name, scale, inertial, lower, upper, 1.0 if inertial else spread / scale)
        )
    for effect in model.effects.values():
        coordinates += [presliding(effect.name)] if "presliding" in effect.scanned else []
    return coordinates, tied


SHORTEST = 1e-3
"""Least presliding distance of a fit, as a share of the least that a model is written with.

What friction lacks at a turn goes with the root of it. At 0.1 nm the mass of a slide whose true
friction gives way at once came out 0.06 % too large, 13 standard errors.
"""


def presliding(effect: str) -> Coordinate:
    """How far a contact gives before it slides, which no list of parameters has free."""
    quantity = quantity_of(f"{effect}.presliding")
    low, high = SHORTEST * quantity.to_si(quantity.lower), quantity.to_si(quantity.upper)
    return Coordinate(f"{effect}.presliding", 1.0, True, low, high, 2.0)
