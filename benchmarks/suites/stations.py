"""Stations that differ from their model: drawn once and for all by a suite's recipe."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from benchmarks.suites.feasibility import inability
from benchmarks.suites.recipe import Recipe, RecipeError
from pma_gym.effects.effect import Value
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.parameter_rows import Note
from pma_gym.tasks import varied_station

DIGITS = 6
"""Digits of every drawn number: a station can be printed, and is the same on every machine."""

ATTEMPTS = 200
"""Draws after which a recipe is taken to allow no station."""


class DrawnStation(NamedTuple):
    """A station as it was drawn.

    Attributes:
        model: its own model, which no controller receives.
        present: names of the occasional effects that it has.
        refused: why draws before this one were not taken.
    """

    model: Model
    present: tuple[str, ...]
    refused: tuple[str, ...]


def draw_station(recipe: Recipe, number: int) -> DrawnStation:
    """The station of a number.

    Drawn are every parameter with an interval, from its interval widened (brought back where they
    do not go together, see `pma_gym.tasks.station_within_intervals`), a common factor on the
    damping and one on the muscle's force, and which effects are there, how strong. A station that
    cannot do the tasks is drawn again.

    All stations have one structure: an effect that a station has not is there at its neutral
    value, so one compiled kernel serves them all.

    Raises:
        RecipeError: no draw could do the tasks.
    """
    bits = np.random.Philox(np.random.SeedSequence([recipe.seed, number]))
    generator = np.random.Generator(bits)
    refused: list[str] = []
    for _ in range(ATTEMPTS):
        model, present = _drawn(recipe, generator)
        why = inability(model, recipe)
        if not why:
            name = f"{recipe.model}-{number}"
            title = f"{recipe.model}, drawn with seed {recipe.seed}: number {number}"
            return DrawnStation(replace(model, name=name, title=title), present, tuple(refused))
        refused.append(why)
    raise RecipeError(
        f"none of {ATTEMPTS} draws of station {number} could do the tasks, the last one: "
        f"{refused[-1]}; narrow the ranges or raise reach_v"
    )


def _drawn(recipe: Recipe, generator: np.random.Generator) -> tuple[Model, tuple[str, ...]]:
    """A draw, and which occasional effects it has."""
    varied = varied_station(_widened(recipe), generator, recipe.variation)
    present, effects = [], dict[str, Mapping[str, Value]]()
    for effect in recipe.effects:
        # Drawn whether it is there or not: a change of one share leaves the other effects.
        there = generator.random() < effect.share
        drawn = {d: _between(ends, generator.random()) for d, ends in effect.ranges.items()}
        drawn |= {d: factor * drawn[to] for d, (to, factor) in effect.tied.items()}
        effects[effect.name] = drawn if there else {}
        present += [effect.name] if there else []
    model = varied.with_effects(effects)
    return model.replace(_rounded(model)), tuple(present)


@lru_cache(maxsize=4)
def _widened(recipe: Recipe) -> Model:
    """The nominal model with its intervals widened about their values."""
    model = load_model(recipe.model)
    notes = {path: _wider(model, path, note, recipe.widening) for path, note in model.notes.items()}
    return replace(model, notes=notes)


def _wider(model: Model, path: str, note: Note, widening: float) -> Note:
    if note.low is None or note.high is None:
        return note
    effect, _, file_key = path.partition(".")
    value = model.values_in_files(effect)[file_key]
    assert isinstance(value, float)
    low, high = (value + widening * (end - value) for end in (note.low, note.high))
    return replace(note, low=low, high=high)


def _between(ends: tuple[float, float], share: float) -> float:
    low, high = ends
    if 0.0 < 3.0 * low < high:
        return low * (high / low) ** share
    return low + share * (high - low)


def _rounded(model: Model) -> dict[str, Value]:
    """All of a model's numbers with `DIGITS` digits, by their paths."""
    return {
        f"{effect}.{file_key}": tuple(map(_short, value))
        if isinstance(value, tuple)
        else _short(value)
        for effect in model.parameters
        for file_key, value in model.values_in_files(effect).items()
    }


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
