"""Tasks: what to follow, what it is worth, when it ends, what is randomised."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.protocol import DISPLACEMENT, ROTATION, Protocol
from pma_gym.effects import Effect
from pma_gym.effects.arithmetic import exponential
from pma_gym.effects.effect import Value
from pma_gym.kernels.generic import where
from pma_gym.metrics import PHASE_DURATION, PHASE_SAMPLES, SAMPLE_RATE_HZ, phase_times, rmse
from pma_gym.plant.model import Model
from pma_gym.plant.statics import muscle_force
from pma_gym.units import Quantity

TRIAL_TAIL_S = (PHASE_SAMPLES - 1) / SAMPLE_RATE_HZ - PHASE_DURATION
"""How far past its 5 s the last phase is recorded (s): its last sample is at 1922 / 384 s."""


@dataclass(frozen=True)
class Task:
    """A protocol to follow and the pressures to follow it at.

    Attributes:
        name: `displacement` or `rotation`.
        protocol: phases and ideal reference.
        lowest_pressure: lower end of the pressures of the dissertation's trials (Pa).
        highest_pressure: upper end (Pa).
    """

    name: str
    protocol: Protocol
    lowest_pressure: float
    highest_pressure: float

    @property
    def duration(self) -> float:
        """How long an episode lasts (s): to the last scored sample."""
        return self.protocol.duration + TRIAL_TAIL_S

    def steps(self, control_rate: float) -> int:
        """Control steps of an episode at a rate (Hz): the last one reaches the last sample.

        >>> [task.steps(100.0) for task in TASKS.values()]
        [501, 1501]
        """
        # Less than a sample's rounding: 384 Hz needs 1922 steps, not 1923.
        return math.ceil(self.duration * control_rate - 1e-9)

    def error_percent(self, error: Any) -> Any:  # noqa: ANN401
        """An error (m or rad) in percent of the task's range."""
        return 100.0 * error / self.protocol.span


TASKS: dict[str, Task] = {
    "displacement": Task("displacement", DISPLACEMENT, 150e3, 575e3),
    "rotation": Task("rotation", ROTATION, 275e3, 575e3),
}
"""The dissertation's two tasks; figures 31-36 show them."""


def phase_errors(
    protocol: Protocol, position: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Error of a position on the 384 Hz grid, phase by phase, each on its own ideal line.

    Args:
        protocol: the protocol.
        position: extension (m) or rotation (rad) at k / 384 s, shape (n,).
    Returns:
        Error (m or rad) by phase name: 1923 samples, or as many as there are.
    """
    errors = {}
    for phase in protocol.phases:
        first = round(phase.start * SAMPLE_RATE_HZ)
        actual = position[first : first + PHASE_SAMPLES]
        errors[phase.name] = actual - phase.reference(phase_times()[: len(actual)])
    return errors


def phase_rmse(protocol: Protocol, position: NDArray[np.float64]) -> dict[str, float]:
    """RMSE of a position on the 384 Hz grid, of each phase begun and of them all together.

    Args:
        protocol: the protocol.
        position: extension (m) or rotation (rad) at k / 384 s, shape (n,), n at least 1.
    Returns:
        RMSE (m or rad) by phase name, and `all`: over the samples of all phases.
    """
    begun = {name: e for name, e in phase_errors(protocol, position).items() if len(e)}
    known = {name: rmse(error) for name, error in begun.items()}
    return known | {"all": rmse(np.concatenate(list(begun.values())))}


def absolute_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """Minus the absolute error in percent of the range: -|e|."""
    return -abs(error_percent)


def quadratic_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """Minus the squared error in percent of the range: -e^2."""
    return -error_percent * error_percent


def gaussian_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """exp(-e^2) of the error in percent of the range, between 0 and 1; 0 beyond e^2 = 12."""
    square = error_percent * error_percent
    near = square < GAUSSIAN_END
    return where(near, exponential(-where(near, square, 0.0)), 0.0)


def smooth_reward(error_percent: Any, change: Any) -> Any:  # noqa: ANN401
    """The absolute reward less a tenth of the action's change: -|e| - 0.1 |da|."""
    return -abs(error_percent) - 0.1 * abs(change)


GAUSSIAN_END = 12.0
"""Squared error beyond which the gaussian reward is 0, where it would be 6e-6."""


Reward = Callable[[Any, Any], Any]
"""Reward of a step: of the true error at its end (percent of range), and of the largest change
of an action (which runs from -1 to 1) since the step before. Written in the arithmetic of laws, so
that kernels compute it too."""

REWARDS: dict[str, Reward] = {
    "absolute": absolute_reward,
    "quadratic": quadratic_reward,
    "gaussian": gaussian_reward,
    "smooth": smooth_reward,
}
"""Rewards by name."""


def missed_reward(reward: Reward) -> float:
    """Reward of each step that a terminated episode did not reach: an error of the whole range.

    Following badly to the end is worth more, so that breaking the rig never pays.
    """
    return reward(100.0, 0.0)


LIMITS: tuple[tuple[str, str, float], ...] = (
    ("contraction", "contraction", 1.0),
    ("contraction", "stretch", -1.0),
    ("load", "tension", 1.0),
    ("pressure", "pressure", 1.0),
)
"""What breaks the rig: output, the field of `[limits]` that bounds it, and its sign."""


def broken(limits: Any, truth: Mapping[str, Any]) -> Any:  # noqa: ANN401
    """Which of `LIMITS` a state breaks, counted from 1; 0.0 for none. Numbers or traced values.

    Args:
        limits: the rig's parameters of `[limits]` (SI).
        truth: contraction (m), load (N), pressure (Pa).
    """
    found = 0.0
    # A state that is no number keeps no limit. The first of several counts.
    for i, (output, limit, sign) in reversed(list(enumerate(LIMITS, 1))):
        found = where(sign * truth[output] <= getattr(limits, limit), found, float(i))
    return found


def broken_limit(model: Model, truth: Mapping[str, float]) -> str | None:
    """Which physical limit of the rig a state breaks, in words; None if none.

    Args:
        model: the rig's model, with its limits.
        truth: contraction (m), load (N), pressure (Pa).
    """
    return limit_in_words(model, broken(model.parameters["limits"], truth))


def limit_in_words(model: Model, code: float) -> str | None:
    """The limit of `LIMITS` that `broken` found, in words; None for 0."""
    limits = model.parameters["limits"]
    words = (
        "",
        f"contraction above {limits.contraction * 1e3:g} mm",
        f"muscle stretched over {limits.stretch * 1e3:g} mm beyond its resting length",
        f"cable tension above {limits.tension:g} N",
        f"pressure above {limits.pressure / 1e3:g} kPa",
    )
    return words[int(code)] or None


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
    drawn = _brought_back(model, drawn, "drive", _lets_go)
    return model.replace(drawn)


def _brought_back(
    model: Model, drawn: dict[str, Value], port: str, holds: Callable[[Model], bool]
) -> dict[str, Value]:
    names = [name for name, effect in model.effects.items() if effect.port == port]
    paths = [path for path in drawn if path.partition(".")[0] in names]
    nominal = {f"{n}.{door}": value for n in names for door, value in model.at_the_door(n).items()}
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


def _lets_go(drawn: Model) -> bool:
    return drawn.parameters["drive"].offset <= 0.0


VARIATION = 0.2
"""How far `varied` scales damping and force either way."""


def varied_station(model: Model, generator: np.random.Generator) -> Model:
    """As `intervals`, then damping and the muscle's force each scaled by up to 20 % either way.

    What is scaled is every parameter in newtons per whatever (N, N/kPa, N s/mm) of the effects at
    the muscle's ports. A geometric force law has none and keeps its force.
    """
    drawn = station_within_intervals(model, generator)
    factors = 1.0 + VARIATION * generator.uniform(-1.0, 1.0, 2)
    by_port = dict(zip(("muscle_damping", "muscle_force"), map(float, factors), strict=True))
    scaled: dict[str, Value] = {}
    for effect in drawn.effects.values():
        if effect.port in by_port:
            scaled |= _scaled(drawn, effect, by_port[effect.port])
    return drawn.replace(scaled)


def _scaled(model: Model, effect: Effect, factor: float) -> dict[str, Value]:
    """An effect's parameters in newtons, scaled; lengths and breakpoints stay."""
    paths = {
        f"{effect.name}.{door}": value for door, value in model.at_the_door(effect.name).items()
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
    effect, _, door = path.partition(".")
    return model.effects[effect].quantities[model.effects[effect].names_at_the_door()[door]]


RANDOMISATIONS: dict[str, Callable[[Model, np.random.Generator], Model]] = {
    "none": nominal_station,
    "intervals": station_within_intervals,
    "varied": varied_station,
}
"""What of the station is drawn anew at every reset, by name."""
