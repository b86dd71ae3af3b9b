"""A plant's equations in another notation than traced values: symbols or text.

The rig writes the same equations (`station.py`, `cascade.py`); the notation defines the result of a
law.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from pma_gym.codegen.graph import HELD, Graph
from pma_gym.codegen.rebinding import rebind
from pma_gym.effects.effect import Effect, Parameters
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import Model


class Names:
    """Replacement of the graph that makes inputs by name.

    Args:
        make: makes an input from a name.
        constant: makes a constant from a number; returns other values unchanged.
    """

    inputs = Graph.inputs

    def __init__(self, make: Callable[[str], Any], constant: Callable[[Any], Any]) -> None:
        self._make, self.constant, self.value = make, constant, constant

    def input(self, name: str, level: int = HELD) -> Any:  # noqa: ANN401
        """Return the input with a name."""
        return self._make(name)


class Notation(PlantEquations):
    """A plant's equations with values of another notation.

    Args:
        model: the model.
        names: makes inputs and constants.

    Attributes:
        roads: effects with a rate-independent state, keyed by the state.
    """

    def __init__(self, model: Model, names: Names) -> None:
        self.graph: Any = names
        self.effects = model.effects
        inputs: Any = names.inputs
        self.parameters: dict[str, Parameters] = {
            name: inputs(name, values) for name, values in model.parameters.items()
        }
        self.interpolation = "zoh"
        self.named: Any = {name: names.input(name) for name in (*COMMANDS, ZERO)}
        self.states, self.rate_independent_states, self.events = [], [], []
        self.outputs: Any = {}
        self.travelled: Any = None
        self.roads: dict[str, Effect] = {}
        rebind(model.rig.write_equations, {"trace": self.apply})(self)

    @abstractmethod
    def apply(self, law: Callable, *arguments: Any) -> Any:  # noqa: ANN401
        """Return a law's value for its arguments, in this notation."""

    def call(self, effect: Effect, law: Callable, **other: Any) -> Any:  # noqa: ANN401
        """Return the value of an effect's law, as in the compiled equations."""
        return rebind(PlantEquations.call, {"trace": self.apply})(self, effect, law, **other)

    def memory(self, effect: Effect) -> Any:  # noqa: ANN401
        """Return the present state of an effect."""
        if effect.rate_independent_law is None:
            return super().memory(effect)
        (name,) = effect.memory_names
        self.roads[name] = effect
        return self[name]

    def add_event(self, *_: Any, **__: Any) -> None:
        """Do nothing: the ends of steps are not part of the equations."""

    def add_breakpoints(self) -> None:
        """Do nothing, as for events."""
