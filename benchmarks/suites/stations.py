"""Stations that differ from their model: drawn once and for all by a suite's recipe.

A recipe of stations: what is drawn about a nominal model, how far, and what they must do.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.effects import CATALOGUE
from pma_gym.effects.effect import Value
from pma_gym.plant.model import Model, load_model
from pma_gym.plant.parameter_rows import Note
from pma_gym.plant.plant import Plant
from pma_gym.tasks import Task, broken, limit_in_words, named_task, varied_station
from pma_gym.units import SI_FACTORS


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


RAMP_S = 10.0
"""How long a voltage takes to its end when a station is tried (s): twice as long as the motor has
in the tasks, so that what it reaches, it reaches almost at rest."""

SAMPLES = 101
"""Samples of such a ramp."""

LOWEST_PRESSURE = 150e3
"""Lowest pressure of the trials (Pa)."""

LEAST_DAMPING = 0.25
"""Least damping of a drawn muscle, as a share of the nominal one at the lowest pressure: drawn each
from its own interval, the law's two numbers often give none at all."""

Ramp = tuple[dict[str, NDArray[np.float64]], float]
"""True outputs along a ramp (SI), and the contraction that it began at (m)."""


def inability(model: Model, recipe: Recipe) -> str:
    """Return why a station cannot do a recipe's tasks; empty if it can.

    It can if its drive lets go at 0 V, its muscle is damped, its regulator reaches every pressure,
    and a slow ramp of the actuator's voltage ends beyond every task's range, without breaking the
    rig on the way there.
    """
    if model.parameters["drive"].offset > 0.0:
        return "its drive pulls at 0 V"
    damped = _damping(model) / _nominal_damping(recipe)
    if damped < LEAST_DAMPING:
        return f"its damping is {damped:.2g} of the nominal one at {LOWEST_PRESSURE / 1e3:g} kPa"
    plant, ramps = Plant(model), dict[tuple[float, float], Ramp]()
    for name, pressures in recipe.trials.items():
        task = named_task(name)
        assert task is not None
        for pressure_kpa in pressures:
            try:
                which = task.load, 1e3 * pressure_kpa
                if which not in ramps:
                    ramps[which] = _ramp(plant, *which, recipe.reach_v)
                why = _falls_short(plant.model, task, *ramps[which])
            except ValueError as error:
                why = str(error)
            if why:
                return f"{name} at {pressure_kpa:g} kPa: {why}"
    return ""


@lru_cache(maxsize=4)
def _nominal_damping(recipe: Recipe) -> float:
    return _damping(load_model(recipe.model))


def _damping(model: Model) -> float:
    """Damping at the trials' lowest pressure (N s/m), of a law that is linear in pressure."""
    law = model.parameters.get("symmetric_damping")
    if law is None:
        return 1.0
    return law.intercept + law.slope * LOWEST_PRESSURE


def _ramp(plant: Plant, load: float, pressure: float, end_v: float) -> Ramp:
    """A station whose motor's voltage rises, or under a load (N) its regulator's."""
    regulator, drive = plant.regulator_voltage(pressure), plant.model.parameters["drive"]
    motor = (load - drive.offset) / drive.gain if load else 0.0
    rest = plant.settle(motor, regulator_voltage=regulator)
    start = float(rest.state[plant.states.index("contraction")])
    time, ones = np.linspace(0.0, RAMP_S, SAMPLES), np.ones(SAMPLES)
    if load:
        states, zero = plant.run(
            time, motor * ones, np.linspace(regulator, end_v, SAMPLES), condition=rest
        )
    else:
        states, zero = plant.run(
            time, np.linspace(0.0, end_v, SAMPLES), regulator * ones, condition=rest
        )
    return plant.observe(states, zero), start


def _falls_short(
    model: Model, task: Task, truth: dict[str, NDArray[np.float64]], start: float
) -> str:
    """Why a ramp does not reach the end of a task's range; empty if it does."""
    quantity, unit = task.schedule.quantity, task.schedule.unit
    position = truth[quantity] - (start if task.schedule.followed.shortens else 0.0)
    there = int(np.argmax(position >= task.schedule.span))
    if position[there] < task.schedule.span:
        return f"it only reaches {position.max() / SI_FACTORS[unit]:.3g} {unit}"
    codes = broken(model.parameters["limits"], {n: v[: there + 1] for n, v in truth.items()})
    return limit_in_words(model, float(np.max(codes)))


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
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence([recipe.seed, number])))
    refused: list[str] = []
    for _ in range(ATTEMPTS):
        model, present = _drawn(recipe, generator)
        why = inability(model, recipe)
        if not why:
            return DrawnStation(
                replace(
                    model,
                    name=f"{recipe.model}-{number}",
                    title=f"{recipe.model}, drawn with seed {recipe.seed}: number {number}",
                ),
                present,
                tuple(refused),
            )
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
