"""Randomisations of the station, drawn at every reset, by name."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pma_gym.effects import Effect
from pma_gym.effects.effect import Value, signals
from pma_gym.plant.model import Model
from pma_gym.plant.statics import muscle_force
from pma_gym.tasks.task import TASKS
from pma_gym.units import Quantity


def nominal_station(model: Model, generator: np.random.Generator) -> Model:
    """The model as it is."""
    return model


FORCE_TOLERANCE = 40.0
"""How far a drawn static force may lie from the nominal one (N): some 2 mm of contraction, twice
what the identified station misses table I3 by."""

CORNERS = np.array([[150, 24], [150, 0], [350, 52], [350, 20], [575, 65], [575, 30]]) * (1e3, 1e-3)
"""Pressure (Pa) and contraction (m) where table I3 ends: at no load, and at its greatest."""


def station_within_intervals(model: Model, generator: np.random.Generator) -> Model:
    """Every parameter that has an interval drawn uniformly from it, as far as they go together.

    A fit's parameters make up for each other: drawn one by one, those of a force law give muscles
    that no data allow (no-load contractions of 26 to 129 mm). So those of the muscle's force, and
    those of the regulator's line and of the drive, are brought back together, halfway to the
    nominal at a time, until the force lies within 40 N of the nominal at the corners of table I3,
    the regulator reaches the trials' highest pressure, and the drive lets go at 0 V, as a trial
    that begins with no load needs.
    """
    drawn: dict[str, Value] = {}
    for path, note in model.notes.items():
        share = float(generator.random())
        if note.low is not None and note.high is not None:
            drawn[path] = _bounded(model, path, note.low + share * (note.high - note.low))
    drawn = _brought_back(model, drawn, "muscle_force", _pulling_as(model))
    drawn = _brought_back(model, drawn, "regulator_line", _reaches_highest_pressure)
    drawn = _brought_back(
        model, drawn, "drive", lambda drawn: drawn.parameters["drive"].offset <= 0.0
    )
    return model.replace(drawn)


def _brought_back(
    model: Model, drawn: dict[str, Value], port: str, holds: Callable[[Model], bool]
) -> dict[str, Value]:
    # What has a memory, as hysteresis has, is no part of the static force, and stays as drawn.
    static = {n: e for n, e in model.effects.items() if e.law and "memory" not in signals(e.law)}
    names = [name for name, effect in static.items() if effect.port == port]
    paths = [path for path in drawn if path.partition(".")[0] in names]
    nominal = {
        f"{n}.{file_key}": value
        for n in names
        for file_key, value in model.values_in_files(n).items()
    }
    for _ in range(10 if paths else 0):
        if holds(model.replace({path: drawn[path] for path in paths})):
            break
        drawn = drawn | {path: 0.5 * (drawn[path] + nominal[path]) for path in paths}  # type: ignore[operator]
    return drawn


def _pulling_as(nominal: Model) -> Callable[[Model], bool]:
    """Whether a model's muscle pulls about as a nominal one's."""
    pressure, contraction = CORNERS.T
    # A muscle without an interval is asked for nothing: a cascade has none at all.
    usual = muscle_force(nominal)(pressure, contraction)

    def holds(drawn: Model) -> bool:
        difference = muscle_force(drawn)(pressure, contraction) - usual
        return bool(np.all(np.abs(difference) <= FORCE_TOLERANCE))

    return holds


def _reaches_highest_pressure(drawn: Model) -> bool:
    line = drawn.parameters["regulator_line"]
    return all(10.0 * line.gain + line.offset >= task.highest_pressure for task in TASKS.values())


VARIATION = 0.2
"""How far `varied` scales damping and force either way."""


def varied_station(
    model: Model, generator: np.random.Generator, variation: float = VARIATION
) -> Model:
    """As `intervals`, then damping and the muscle's force each scaled by up to 20 % either way.

    What is scaled is every parameter in newtons per whatever (N, N/kPa, N s/mm) of the effects at
    the muscle's ports. A geometric force law has none and keeps its force.
    """
    drawn = station_within_intervals(model, generator)
    factors = 1.0 + variation * generator.uniform(-1.0, 1.0, 2)
    by_port = dict(zip(("muscle_damping", "muscle_force"), map(float, factors), strict=True))
    scaled: dict[str, Value] = {}
    for effect in drawn.effects.values():
        if effect.port in by_port:
            scaled |= _scaled(drawn, effect, by_port[effect.port])
    return drawn.replace(scaled)


def _scaled(model: Model, effect: Effect, factor: float) -> dict[str, Value]:
    """An effect's parameters in newtons, scaled; lengths and breakpoints stay."""
    paths = {
        f"{effect.name}.{file_key}": value
        for file_key, value in model.values_in_files(effect.name).items()
    }
    return {
        path: _bounded(model, path, value * factor)
        for path, value in paths.items()
        if isinstance(value, float) and _quantity(model, path).unit.startswith("N")
    }


def _bounded(model: Model, path: str, value: float) -> float:
    quantity = _quantity(model, path)
    return min(max(value, quantity.lower), quantity.upper)


def _quantity(model: Model, path: str) -> Quantity:
    effect, _, file_key = path.partition(".")
    return model.effects[effect].quantities[model.effects[effect].names_in_files()[file_key]]


@dataclass(frozen=True)
class Ranges:
    """Draws parameters evenly from ranges.

    Attributes:
        ends: lowest and highest value by `effect.parameter_unit`, in file units.
    """

    ends: Mapping[str, Sequence[float]]

    def __call__(self, model: Model, generator: np.random.Generator) -> Model:
        """The model with drawn values."""
        ends = sorted(self.ends.items())
        return model.replace(
            {path: float(generator.uniform(low, high)) for path, (low, high) in ends}
        )


@dataclass(frozen=True)
class Uncertainty:
    """Draws parameters about the model's as a fit's covariance has them, within their bounds.

    Attributes:
        paths: parameters, `effect.parameter_unit`.
        covariance: of them in file units, shape (paths, paths).
        values: what the model has first, by path, in file units: those of a rival.
    """

    paths: Sequence[str]
    covariance: Sequence[Sequence[float]]
    values: Mapping[str, Value] = field(default_factory=dict)

    def __call__(self, model: Model, generator: np.random.Generator) -> Model:
        """The model with drawn values."""
        model = model.replace(self.values) if self.values else model
        known = {p: v for e in model.effects for k, v in model.values_in_files(e).items()
                 if (p := f"{e}.{k}") in self.paths}  # fmt: skip
        middle = [known[path] for path in self.paths]
        if not middle:
            return model
        drawn = generator.multivariate_normal(middle, self.covariance, method="eigh")
        pairs = zip(self.paths, drawn.tolist(), strict=True)
        return model.replace({path: _bounded(model, path, value) for path, value in pairs})


@dataclass(frozen=True)
class OneOf:
    """Draws one of some randomisations, all as likely, and the model from it.

    Attributes:
        randomisations: one for each model that may be right.
    """

    randomisations: "Sequence[Randomisation]"

    def __call__(self, model: Model, generator: np.random.Generator) -> Model:
        """The model that one of them draws."""
        draw = self.randomisations[int(generator.integers(len(self.randomisations)))]
        return draw(model, generator)


Randomisation = Callable[[Model, np.random.Generator], Model]
"""Draws an episode's station from the nominal model with the given generator."""

RANDOMISATIONS: dict[str, Randomisation] = {
    "none": nominal_station,
    "intervals": station_within_intervals,
    "varied": varied_station,
}
"""Randomisations of the station, drawn at every reset, by name."""
