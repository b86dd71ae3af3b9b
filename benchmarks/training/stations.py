"""Stations that policies are trained and validated on: draws that no suite has."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.suites.frozen import frozen_suite
from benchmarks.suites.stations import Recipe, draw_station
from benchmarks.suites.suite import SuiteError
from pma_gym.engine.nominal_rig import nominal_model
from pma_gym.plant.model import Model, load_model
from pma_gym.tasks import EXERCISES

TRAINING = 128
"""How many stations a policy is trained on."""

VALIDATION_FIRST, VALIDATION = 10_000, 64
"""Number of the first station that policies are validated on, and how many there are."""

HAND_PUSH = {"hand_push": {"share": 1.0}}
"""What an environment with a pushing hand adds to its model."""

ADDED = ("hand_push", "leg")
"""Effects that an environment adds to its model: of somebody at the slide, of an exercise."""


class Stations:
    """A randomisation: each episode gets one of some stations of a suite's recipe.

    They are drawn with the recipe's training seed, so none is a station of the suite.

    Args:
        suite: name of the suite whose recipe it is.
        first: number of the first one.
        count: how many.

    Attributes:
        recipe: by which they are drawn.
    """

    def __init__(self, suite: str, first: int = 0, count: int = TRAINING) -> None:
        self.recipe = training_recipe(suite)
        self.first, self.count = first, count

    @property
    def options(self) -> dict[str, Any]:
        """Options of an environment whose episodes are on them.

        Its model is the nominal one with every effect that a station may have, neutral.
        """
        effects = {effect.name: {} for effect in self.recipe.effects}
        return {"randomisation": self, "model": load_model(self.recipe.model).with_effects(effects)}

    def __call__(self, nominal: Model, generator: np.random.Generator) -> Model:
        """The station of an episode."""
        number = int(generator.integers(self.count))
        return self.of(number, tuple(name for name in ADDED if name in nominal.parameters))

    def of(self, number: int, added: tuple[str, ...] = ()) -> Model:
        """A station by its number among these, with those of `ADDED` that are asked for."""
        return _station(self.recipe, self.first + number, added)


def training_recipe(suite: str) -> Recipe:
    """Return a suite's recipe with its training seed in place of the suite's seed.

    Raises:
        SuiteError: no such suite, or one that draws no stations.
    """
    recipe = frozen_suite(suite).recipe
    if recipe is None:
        raise SuiteError(f"suite {suite} draws no stations; train on those of robust")
    if recipe.training_seed == recipe.seed:
        raise SuiteError(f"suite {suite}: training_seed must differ from seed, both are the same")
    return _trained(recipe)


@lru_cache(maxsize=8)
def _trained(recipe: Recipe) -> Recipe:
    return replace(recipe, seed=recipe.training_seed)


@lru_cache(maxsize=4096)
def _station(recipe: Recipe, number: int, added: tuple[str, ...]) -> Model:
    if not added:
        return draw_station(recipe, number).model
    *others, last = added
    model = _station(recipe, number, tuple(others))
    if last == "hand_push":
        return model.with_effects(HAND_PUSH)
    # Any exercise will do: all have the leg that controllers receive.
    return nominal_model(EXERCISES["isokinetic_exercise"], model)
