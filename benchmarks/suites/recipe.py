"""A recipe of stations: what is drawn about a nominal model, how far, and what they must do."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from pma_gym.effects import CATALOGUE
from pma_gym.plant.model import load_model


class RecipeError(ValueError):
    """A recipe that no station can be drawn by; the message says why and the fix."""


class Occasional(NamedTuple):
    """An effect that some of the stations have.

    Attributes:
        name: the effect's, in the catalogue.
        share: probability that a station has it.
        ranges: lowest and highest value of each of its parameters by name in files; drawn
            evenly between them, evenly in the logarithm if the highest is over 3 times the lowest.
        tied: parameters that are another one times a factor, by name in files.
    """

    name: str
    share: float
    ranges: Mapping[str, tuple[float, float]]
    tied: Mapping[str, tuple[str, float]]


@dataclass(frozen=True, eq=False)
class Recipe:
    """Recipe to draw stations around a nominal model.

    Attributes:
        model: name of the nominal model.
        seed: of the draws; a station's own depend on it and the station's number alone.
        training_seed: of the draws that controllers may be tuned on.
        widening: factor on the distance of an interval's ends from the nominal value.
        variation: how far damping and the muscle's force are scaled either way.
        reach_v: voltage of the actuator (V) by which a station must have reached the end of every
            task's range.
        trials: pressures (kPa) by task at which it must.
        effects: those that some of the stations have.
    """

    model: str
    seed: int
    training_seed: int
    widening: float
    variation: float
    reach_v: float
    trials: Mapping[str, tuple[float, ...]]
    effects: tuple[Occasional, ...]


def parse_recipe(table: Mapping[str, Any], model: str) -> Recipe:
    """A recipe from a suite's file.

    Args:
        table: its table `[stations]`.
        model: name of the nominal model.
    Raises:
        RecipeError: a model or an effect that cannot be drawn so.
    """
    if not load_model(model).rig.balances_loads:
        raise RecipeError(f"stations are drawn about the model of a station, {model} is none")
    return Recipe(
        model=model,
        seed=table["seed"],
        training_seed=table["training_seed"],
        widening=table["widening"],
        variation=table["variation"],
        reach_v=table["reach_v"],
        trials={task: tuple(pressures) for task, pressures in table["trials"].items()},
        effects=tuple(_occasional(entry) for entry in table.get("effects", ())),
    )


def _occasional(table: Mapping[str, Any]) -> Occasional:
    name, share = table["name"], table["share"]
    if name not in CATALOGUE or CATALOGUE[name].neutral is None:
        raise RecipeError(f"no effect {name!r} that a station may have or not; see the catalogue")
    ranges = {file_key: tuple(ends) for file_key, ends in table["ranges"].items()}
    tied = {file_key: (tie["to"], tie["factor"]) for file_key, tie in table.get("tied", {}).items()}
    names, given_here = CATALOGUE[name].names_in_files(), [*ranges, *tied]
    # What has a default in model files has it here: it is not drawn.
    needed = [d for d in names if d in given_here or d not in CATALOGUE[name].defaults]
    if sorted(given_here) != sorted(needed) or any(to not in ranges for to, _ in tied.values()):
        spare = ", ".join(CATALOGUE[name].defaults)
        needs = ", ".join(d for d in names if d not in CATALOGUE[name].defaults)
        needs += f"; {spare} may be left out" if spare else ""
        raise RecipeError(f"{name} needs a range or a tie for each of {needs}")
    if not 0.0 <= share <= 1.0:
        raise RecipeError(f"the share of {name} must lie in 0 to 1, got {share!r}")
    for file_key, ends in ranges.items():
        if len(ends) != 2 or ends[0] > ends[1]:
            raise RecipeError(
                f"the range of {name}.{file_key} must be [lowest, highest], got {ends}"
            )
        for end in ends:
            CATALOGUE[name].quantities[names[file_key]].check(f"{name}.{file_key}", end)
    return Occasional(name, share, ranges, tied)
