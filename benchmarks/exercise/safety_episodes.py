"""`python -m benchmarks safety`: how often an exercise hurts, with the safety layer and without.

Every episode has an operator, a station and an agent of its own, all by its seed. Half of the
stations are `varied` (the environments' randomisation of that name), the others are further draws
of the recipe of suite `robust`, with effects that no model has. The safe moment and the safe speed
are watched at the end of every control step.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.executors.executor import Executor, run_or_raise
from benchmarks.hidden_effects.evaluation.scoring import wilson
from benchmarks.training.stations import Stations
from pma_gym.engine.engine import Engine
from pma_gym.engine.options import Options
from pma_gym.tasks import EXERCISES, LIMITS, Task
from pma_gym.units import SI_FACTORS

Volts = NDArray[np.float64]
"""Regulator voltages of every control step (V), shape (steps,)."""

HIGHEST_V = 10.0
SLOWEST_HZ, FASTEST_HZ = 0.3, 3.0
"""Frequencies of the square waves: about those at which a leg swings on the muscle."""

WANDER_V = 3.0
"""How far the wandering voltage goes in a second, in the mean of squares (V)."""


def _noise(generator: np.random.Generator, steps: int, period: float) -> Volts:
    return generator.uniform(0.0, HIGHEST_V, steps)


def _switching(generator: np.random.Generator, steps: int, period: float) -> Volts:
    mean = generator.exponential(0.3) / period
    flips = generator.random(steps) < 1.0 / max(mean, 1.0)
    return np.where(np.cumsum(flips) % 2 == generator.integers(2), 0.0, HIGHEST_V)


def _square(generator: np.random.Generator, steps: int, period: float) -> Volts:
    turns = generator.uniform(SLOWEST_HZ, FASTEST_HZ) * period * np.arange(steps)
    return np.where((turns + generator.random()) % 1.0 < 0.5, 0.0, HIGHEST_V)


def _constant(generator: np.random.Generator, steps: int, period: float) -> Volts:
    return np.full(steps, generator.uniform(0.0, HIGHEST_V))


def _end(generator: np.random.Generator, steps: int, period: float) -> Volts:
    return np.full(steps, generator.choice([0.0, HIGHEST_V]))


def _wandering(generator: np.random.Generator, steps: int, period: float) -> Volts:
    moves = generator.normal(0.0, WANDER_V * np.sqrt(period), steps)
    return np.clip(generator.uniform(0.0, HIGHEST_V) + np.cumsum(moves), 0.0, HIGHEST_V)


PLANNED: dict[str, Callable[[np.random.Generator, int, float], Volts]] = {
    "noise": _noise,
    "switching": _switching,
    "square wave": _square,
    "constant": _constant,
    "0 or 10 V": _end,
    "wandering": _wandering,
}
"""Commands that are drawn before an episode, by name."""

PUMPING = "pumping"
"""The agent that knows the joint's true speed, lets go where the leg moves out and pulls where it
moves back, so that every swing grows."""

KINDS = (*PLANNED, PUMPING)
"""All of them; an episode's is its number's."""


def kind_of(episode: int) -> str:
    """Kind of an episode's agent."""
    return KINDS[episode % len(KINDS)]


def planned(episode: int, seed: int, steps: int, period: float) -> Volts:
    """Commands of an episode; of the pumping agent only those while the joint rests.

    Args:
        episode: its number.
        seed: of the whole benchmark.
        steps: control steps.
        period: of a control step (s).
    """
    generator = np.random.default_rng([seed, episode])
    made = PLANNED.get(kind_of(episode), _constant)
    return made(generator, steps, period)


def pumped(speeds: NDArray[np.float64], at_rest_volts: Volts) -> Volts:
    """Commands of pumping agents at the joints' speeds (rad/s), shape (n,) each (V)."""
    still = np.abs(speeds) < 1.0 * SI_FACTORS["deg"]
    return np.where(still, at_rest_volts, np.where(speeds > 0.0, 0.0, HIGHEST_V))


BLOCK = 250
"""Episodes that run side by side."""

FIRST_STATION, STATIONS = 30_000, 256
"""Number of the first station drawn by the recipe, and how many there are: none of those that
policies are trained, validated or judged on."""

SETS = ("varied", "robust")
"""Kinds of stations."""

FIRST_SEED = 10_000_000
"""Environment seed of the first episode of benchmark seed 0; the next benchmark seed begins as far
on. Below it are those that the safety layer's numbers were found with."""


@dataclass(frozen=True)
class Tally:
    """Counts over the episodes of one task and one kind of agent.

    Attributes:
        task: name of the task.
        stations: kind of the stations, one of `SETS`.
        agent: kind of the agent.
        safety: whether the safety layer was there.
        episodes: how many.
        moments: how many of them exceeded the safe moment.
        speeds: how many exceeded the safe speed.
        others: how many broke a limit of the rig.
        peak_moment_nm: the greatest moment at a joint (N m).
        peak_speed_deg_s: the greatest speed of a joint (deg/s).
    """

    task: str
    stations: str
    agent: str
    safety: bool
    episodes: int
    moments: int
    speeds: int
    others: int
    peak_moment_nm: float
    peak_speed_deg_s: float

    @property
    def violations(self) -> int:
        """Episodes in which moment or speed was not safe."""
        return self.moments + self.speeds


@dataclass(frozen=True)
class Safety:
    """Everything that was measured.

    Attributes:
        seed: of the benchmark.
        tallies: by task, kind of stations and kind of agent.
    """

    seed: int
    tallies: tuple[Tally, ...]

    def total(self, safety: bool) -> tuple[int, int, float]:
        """Episodes, violations among them, and their largest likely share (Wilson, 95 %)."""
        chosen = [tally for tally in self.tallies if tally.safety == safety]
        episodes = sum(tally.episodes for tally in chosen)
        violations = sum(tally.violations for tally in chosen)
        return episodes, violations, wilson(violations, episodes)[1] if episodes else np.nan

    def to_json(self) -> dict[str, object]:
        """Return the episode as plain numbers and strings."""
        return {"seed": self.seed, "tallies": [asdict(tally) for tally in self.tallies]}


def measure(
    episodes: int,
    seed: int,
    safety: bool,
    executor: Executor,
    on_block: Callable[[int], None] = lambda done: None,
    tasks: Sequence[str] = tuple(EXERCISES),
) -> tuple[Tally, ...]:
    """Run episodes and count.

    Args:
        episodes: how many, shared by the tasks.
        seed: of the benchmark.
        safety: whether the safety layer is there.
        executor: where blocks of episodes run.
        on_block: called with how many more are done.
        tasks: names of the tasks.
    Returns:
        A tally for every task, kind of stations and kind of agent.
    """
    groups = [(name, stations) for name in tasks for stations in SETS]
    # Kinds of agents take turns in each group.
    works = {
        (group, first): partial(
            _run, EXERCISES[group[0]], group[1], safety, seed, first, numbers[first : first + BLOCK]
        )
        for at, group in enumerate(groups)
        for numbers in [np.arange(episodes)[at :: len(groups)]]
        for first in range(0, len(numbers), BLOCK)
    }
    results: dict[int, NDArray[np.float64]] = {}

    def keep(index: int, block: NDArray[np.float64]) -> None:
        results[index] = block
        on_block(len(block))

    run_or_raise(list(works.values()), executor, keep)
    tallies: list[Tally] = []
    for group in groups:
        blocks = [results[k] for k, (its, _) in enumerate(works) if its == group]
        whole = np.concatenate([np.zeros((0, 4)), *blocks])
        tallies += [_tally((*group, kind), safety, whole) for kind in KINDS]
    return tuple(tallies)


def _options(stations: str, safety: bool) -> Options:
    if stations == "varied":
        return Options(randomisation="varied", safety=safety)
    return Options(safety=safety, **Stations("robust", FIRST_STATION, STATIONS).options)


def _run(
    task: Task, stations: str, safety: bool, seed: int, first: int, numbers: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Run a block; shape (m, 4): number of the agent's kind, code of the end, peaks (SI)."""
    options = _options(stations, safety)
    count, every = len(numbers), np.arange(len(numbers))
    engine = Engine(task, options, count)
    start = FIRST_SEED * (seed + 1)
    engine.seed(every, (start + numbers).tolist())
    engine.reset(every)
    order = first + every
    steps = task.steps(options.control_rate_hz)
    volts = np.array([planned(int(k), seed, steps, options.period) for k in order])
    pumps = np.array([kind_of(int(k)) == PUMPING for k in order])
    ends, peaks, going = np.zeros(count), np.zeros((count, 2)), np.ones(count, np.bool_)
    for k in range(steps):
        asked = volts[:, k]
        if pumps.any():
            asked = np.where(pumps, pumped(engine.numbers("spin"), asked), asked)
        engine.actions[:count, 0] = 0.2 * asked - 1.0
        engine.step()
        over = going & engine.terminated
        if over.any() or k == steps - 1:
            last = over if k < steps - 1 else going
            peaks[last, 0] = engine.numbers("peak_moment")[last]
            peaks[last, 1] = engine.numbers("peak_speed")[last]
            ends[over] = engine.numbers("ended")[over]
            going &= ~over
            engine.park(np.flatnonzero(over))
    return np.column_stack([(order % len(KINDS)).astype(np.float64), ends, peaks])


def _tally(name: tuple[str, str, str], safety: bool, whole: NDArray[np.float64]) -> Tally:
    own = whole[whole[:, 0] == KINDS.index(name[-1])]
    codes, rig = own[:, 1], float(len(LIMITS))
    return Tally(
        *name,
        safety,
        episodes=len(own),
        moments=int(np.sum(codes == rig + 1.0)),
        speeds=int(np.sum(codes == rig + 2.0)),
        others=int(np.sum((codes > 0.0) & (codes <= rig))),
        peak_moment_nm=float(own[:, 2].max(initial=0.0)),
        peak_speed_deg_s=float(own[:, 3].max(initial=0.0)) / SI_FACTORS["deg"],
    )
