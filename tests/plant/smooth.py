"""A smooth system without a closed form, for the order of an integrator's steps."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.graph import CHANGING, Graph
from pma_gym.codegen.text import evaluate
from pma_gym.integrator.equations import State
from pma_gym.integrator.exponential_rosenbrock import Step

START = (2.0, 1.5)
"""Prey and predators."""


def predator_and_prey(step: Callable[..., Step]) -> Step:
    """A step of prey and predators."""
    graph = Graph()
    x, y, size = (graph.input(name, CHANGING) for name in ("x", "y", "size"))
    states = [State("x", x, x * (1.0 - y), 1.0), State("y", y, y * (x - 1.0), 1.0)]
    return step(states, size, {}, {})


def integrated(made: Step, duration: float, count: int) -> NDArray[np.float64]:
    """Both after some steps from the start."""
    state = list(START)
    for _ in range(count):
        given = {"x": state[0], "y": state[1], "size": duration / count}
        state = [float(value) for value in evaluate(made.states, given)]
    return np.array(state)


def orders(made: Step) -> NDArray[np.float64]:
    """Orders of convergence from 16 to 128 steps."""
    exact = integrated(made, 2.0, 2048)
    errors = [np.abs(integrated(made, 2.0, count) - exact).max() for count in (16, 32, 64, 128)]
    return np.log2(np.divide(errors[:-1], errors[1:]))


def in_one_step(made: Step) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Estimated and true errors of one step, ever half as long."""
    estimates, truths = [], []
    for size in 0.2 * 0.5 ** np.arange(5):
        given = {"x": START[0], "y": START[1], "size": size}
        estimates.append(max(abs(float(error)) for error in evaluate(made.errors, given)))
        own = np.array([float(value) for value in evaluate(made.states, given)])
        truths.append(np.abs(own - integrated(made, size, 64)).max())
    return np.array(estimates), np.array(truths)
