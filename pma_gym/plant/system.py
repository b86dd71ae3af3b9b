"""A model's equations with the arithmetic of one step, and its muscle's static force."""

from pma_gym.codegen.graph import Value
from pma_gym.codegen.trace import substitute
from pma_gym.integrator.equations import Interpolation
from pma_gym.integrator.integration import Layout
from pma_gym.integrator.step_attempt import step_attempt
from pma_gym.integrator.system import System, step_start_values
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import Model


def system(model: Model, interpolation: Interpolation) -> System:
    """Build a model's equations and step, with first- or zero-order hold of the commands."""
    equations = PlantEquations(model.effects, model.parameters, interpolation)
    model.rig.write_equations(equations)
    equations.finish()
    made = step_attempt(equations, model.rig.position_tolerances)
    return System(equations, made, Layout.of(made))


def memories_at_start(eq: PlantEquations) -> dict[str, Value]:
    """Initial values of effects' states that do not begin at 0, from the parameters, by state."""
    return {
        name: getattr(eq.parameters[effect.name], effect.memory_start)
        for effect in eq.effects.values()
        if effect.memory_start
        for name in effect.memory_names
    }


def static_force(eq: PlantEquations) -> Value:
    """Force of the muscle on the slide at rest, without the cable, at the initial effect states."""
    force = eq["muscle_force"] + eq["slide_force"]
    nothing = eq.graph.constant(0.0)
    start_values = memories_at_start(eq)
    memories = {
        entry.value.id: start_values.get(entry.name, nothing)
        for entry in eq.remembered
        if "memory_" in entry.name
    }
    here = step_start_values(eq) | {eq["velocity"].id: nothing}
    (first,) = substitute([force], here)
    return substitute([first], memories | {eq["velocity"].id: nothing})[0]
