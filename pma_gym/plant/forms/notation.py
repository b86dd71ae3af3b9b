"""A plant's equations in another notation than traced values: symbols, or words.

The plant writes the same equations (`station.py`, `cascade.py`); what a law makes of its arguments
is up to the notation.
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
    """Stands for the graph: gives inputs by name.

    Args:
        make: makes an input of a name.
        constant: makes a constant of a number; leaves what is none.
    """

    inputs = Graph.inputs

    def __init__(self, make: Callable[[str], Any], constant: Callable[[Any], Any]) -> None:
        self._make, self.constant, self.value = make, constant, constant

    def input(self, name: str, level: int = HELD) -> Any:  # noqa: ANN401
        """The input of a name."""
        return self._make(name)


class Notation(PlantEquations):
    """A plant's equations with values of another kind.

    Args:
        model: the model.
        names: makes its inputs and constants.

    Attributes:
        roads: by memory of the way travelled: the effect that has it.
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
        """What a law makes of its arguments."""

    def call(self, effect: Effect, law: Callable, **other: Any) -> Any:  # noqa: ANN401
        """As in the equations that are compiled."""
        return rebind(PlantEquations.call, {"trace": self.apply})(self, effect, law, **other)

    def memory(self, effect: Effect) -> Any:  # noqa: ANN401
        """The memory of an effect, where it stands."""
        if effect.rate_independent_law is None:
            return super().memory(effect)
        (name,) = effect.memory_names
        self.roads[name] = effect
        return self[name]

    def add_event(self, *_: Any, **__: Any) -> None:
        """Nothing: where steps end is no part of the equations."""

    def add_breakpoints(self) -> None:
        """Nothing, as for switches."""
