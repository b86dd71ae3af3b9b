"""Agents that nobody should let near a knee: what the safety layer is tried with."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

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


def pumped(speeds: NDArray[np.float64], otherwise: Volts) -> Volts:
    """Commands of pumping agents at the joints' speeds (rad/s), shape (n,) each (V)."""
    still = np.abs(speeds) < 1.0 * SI_FACTORS["deg"]
    return np.where(still, otherwise, np.where(speeds > 0.0, 0.0, HIGHEST_V))
