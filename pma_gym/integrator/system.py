"""A model's equations with the arithmetic of one step, and their values at its start."""

from dataclasses import dataclass

from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import substitute
from pma_gym.integrator.equations import COMMANDS, Equations
from pma_gym.integrator.integration import Layout
from pma_gym.integrator.step_attempt import StepAttempt


@dataclass(frozen=True)
class System:
    """A model's equations with the arithmetic of one step.

    Attributes:
        equations: the equations.
        attempt: one attempt at a step.
        layout: what a lane works on.
    """

    equations: Equations
    attempt: StepAttempt
    layout: Layout


def step_start_values(eq: Equations) -> dict[int, Value]:
    """Values of the paths and their direction at the start of a step, by id."""
    here = {memory.after.id: memory.value for memory in eq.rate_independent_states}
    if eq.travelled is not None and eq.rate_independent_states:
        here[eq["origin"].id] = eq.travelled[0]
    return here


def rates(eq: Equations) -> list[Value]:
    """Rates of states, then of memories of the way: their slope along it, times the speed."""
    from pma_gym.codegen.derivative import derivative
    from pma_gym.integrator.step_attempt import step_start

    frozen, here = step_start(eq)
    own = [state.rate for state in eq.states if state.name not in COMMANDS]
    rates_there = substitute(own, {**frozen, **here})
    for memory in eq.rate_independent_states:
        assert eq.travelled is not None
        (slope,) = derivative(memory.after, [eq.travelled[0]])
        assert slope is not None
        rates_there.append(substitute([slope], frozen)[0] * eq.travelled[1])
    return rates_there
