"""The numbers that a control step reads, as inputs of its graph."""

from dataclasses import dataclass

from pma_gym.codegen.graph import CHANGING, HELD, Graph, Value
from pma_gym.engine.state_layout import START, StateLayout
from pma_gym.integrator.equations import COMMANDS, ZERO, Equations


@dataclass(frozen=True)
class StepInputs:
    """Inputs of a control step by name.

    Attributes:
        state_layout: places of the numbers.
        equations: the plant's equations, whose graph all of it is in.
    """

    state_layout: StateLayout
    equations: Equations

    @property
    def graph(self) -> Graph:
        """The graph of all values."""
        return self.equations.graph

    def slot(self, name: str) -> Value:
        """A number of the record, as an input; states and commands are the plant's own."""
        if name in self.state_layout.states or name in (*COMMANDS, ZERO):
            return self.equations[name]
        if name == START or name in self.state_layout.prescribed:
            return self.graph.input(name, HELD)
        return self.graph.input(f"record.{name}", CHANGING, self.state_layout.kind(name))

    def action(self, i: int) -> Value:
        """An entry of the action, as an input."""
        return self.graph.input(f"action.{i}", CHANGING)

    def reference(self, steps_ahead: int) -> Value:
        """The reference so many steps after the one that begins (m or rad), as an input."""
        return self.graph.input(f"reference.{steps_ahead}", CHANGING)

    @property
    def horizon(self) -> Value:
        """Control steps after which an episode is truncated, as an input."""
        return self.graph.input("horizon", CHANGING)
