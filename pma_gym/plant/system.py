"""A model's equations with the arithmetic of one step, and what they say where it begins."""

from dataclasses import dataclass

from pma_gym.kernels.graph import Value
from pma_gym.kernels.substitute import substitute
from pma_gym.plant.attempt import Attempt, attempt
from pma_gym.plant.compose import COMMANDS, Equations
from pma_gym.plant.march import Layout
from pma_gym.plant.model import PLANTS, Model


@dataclass(frozen=True)
class System:
    """A model's equations with the arithmetic of one step.

    Attributes:
        equations: the equations.
        attempt: one attempt at a step.
        layout: what a lane works on.
    """

    equations: Equations
    attempt: Attempt
    layout: Layout


def system(model: Model, ramped: bool) -> System:
    """A model's equations and step; with `ramped`, commands change linearly in time."""
    plant = PLANTS[model.plant]
    equations = Equations(model.effects, model.parameters, ramped)
    plant.write_equations(equations)
    equations.finish()
    made = attempt(equations, plant.POSITIONS)
    return System(equations, made, Layout.of(made))


def at_rest(eq: Equations) -> dict[int, Value]:
    """What paths and their direction are where a step begins, by id."""
    here = {path.after.id: path.value for path in eq.paths}
    if eq.travelled is not None and eq.paths:
        here[eq["origin"].id] = eq.travelled[0]
    return here


def rates(eq: Equations) -> list[Value]:
    """Rates of states, then of memories of the way: their slope along it, times the speed."""
    from pma_gym.kernels.derivative import derivative
    from pma_gym.plant.attempt import beginning

    frozen, here = beginning(eq)
    own = [state.rate for state in eq.states if state.name not in COMMANDS]
    found = substitute(own, {**frozen, **here})
    for path in eq.paths:
        assert eq.travelled is not None
        (slope,) = derivative(path.after, [eq.travelled[0]])
        assert slope is not None
        found.append(substitute([slope], frozen)[0] * eq.travelled[1])
    return found


def memories_at_start(eq: Equations) -> dict[str, Value]:
    """The memories that do not begin at 0, as values of the model's parameters, by state."""
    return {
        name: getattr(eq.parameters[effect.name], effect.memory_start)
        for effect in eq.effects.values()
        if effect.memory_start
        for name in effect.memory_names
    }


def static_force(eq: Equations) -> Value:
    """Force of the muscle on the slide at rest, without the cable, memories as trials begin."""
    force = eq["muscle_force"] + eq["slide_force"]
    nothing = eq.graph.constant(0.0)
    begun = memories_at_start(eq)
    memories = {
        entry.value.id: begun.get(entry.name, nothing)
        for entry in eq.remembered
        if "memory_" in entry.name
    }
    here = at_rest(eq) | {eq["velocity"].id: nothing}
    (first,) = substitute([force], here)
    return substitute([first], memories | {eq["velocity"].id: nothing})[0]
