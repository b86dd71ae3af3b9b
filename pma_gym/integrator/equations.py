"""A plant's right-hand side as traced arithmetic: states, rates, memories, events.

What writes it (`pma_gym.plant.composition`) is no concern of the integrator, which reads states,
rates and events from here.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pma_gym.codegen.derivative import derivative
from pma_gym.codegen.graph import CHANGING, FIXED, HELD, Graph, Value
from pma_gym.effects.effect import Parameters

COMMANDS = ("motor_voltage", "regulator_voltage")
"""What a plant is told (V)."""

ZERO = "zero_contraction"
"""Name of the contraction x0 at which a trial began with no load (m)."""


@dataclass(frozen=True)
class State:
    """One state of a plant.

    Attributes:
        name: its name.
        value: the state itself.
        rate: its time derivative.
        scale: what an error of it is counted against (SI); None where it never asks for a step.
    """

    name: str
    value: Value
    rate: Value
    scale: float | None


@dataclass(frozen=True)
class Path:
    """A memory that depends on the way travelled alone.

    Attributes:
        name: its name.
        value: the memory where the step began.
        after: the memory after the way since then.
        scale: what an error of it is counted against.
    """

    name: str
    value: Value
    after: Value
    scale: float


@dataclass(frozen=True)
class Switch:
    """A value at whose zero the right-hand side has a kink.

    Attributes:
        name: its name.
        value: the value.
        rate: its time derivative.
        overshoot: largest overshoot that needs no step to end there, in the value's unit (and
            times its duration, where `turning`).
        turning: whether it is a velocity, whose kinks lie in the way travelled.
    """

    name: str
    value: Value
    rate: Value
    overshoot: float
    turning: bool = False


@dataclass(frozen=True)
class Bend:
    """A value at whose zero a law curves otherwise: a step ends about there.

    Attributes:
        value: the value.
        rate: its time derivative.
    """

    value: Value
    rate: Value


class Equations:
    """A plant's right-hand side.

    Args:
        parameters: parameters (named tuples) by the name of their effect; only how many there are
            matters here.
        ramped: commands change linearly in time; else they are held.

    Attributes:
        graph: the graph of all values.
        parameters: the effects' parameters by name, as values.
        ramped: commands change linearly in time.
        named: values by name: states, commands, and whatever else has been given a name.
        states: the states that have rates, in the order of the state vector.
        paths: the memories of the way travelled, which follow them there.
        switches: where steps end.
        bends: where they end about.
        ways: how far the way of a step may go before a memory of it bends (m), where it begins.
        outputs: true outputs by name.
        travelled: the state whose way they remember, and its rate.
        travel: its way since the step began; None where nothing remembers it.
    """

    def __init__(self, parameters: Mapping[str, Parameters], ramped: bool = False) -> None:
        self.graph = Graph()
        self.parameters = {
            name: self.graph.inputs(name, values, FIXED) for name, values in parameters.items()
        }
        command = CHANGING if ramped else HELD
        self.ramped = ramped
        self.named: dict[str, Value] = {
            ZERO: self.graph.input(ZERO, HELD),
            **{name: self.graph.input(name, command) for name in COMMANDS},
        }
        self.states: list[State] = []
        self.paths: list[Path] = []
        self.switches: list[Switch] = []
        self.bends: list[Bend] = []
        self.ways: list[Value] = []
        self.travelled: tuple[Value, Value] | None = None
        self.travel: Value | None = None
        self.outputs: dict[str, Value] = {}

    def finish(self) -> None:
        """Add the commands as states of constant rate, if they are ramped."""
        for name in COMMANDS if self.ramped else ():
            self.add_state(name, self.graph.input(f"{name}_slope", HELD), None)

    @property
    def remembered(self) -> list[State | Path]:
        """States and memories, without commands: the state vector."""
        return [*(state for state in self.states if state.name not in COMMANDS), *self.paths]

    def __getitem__(self, name: str) -> Value:
        """A value by name; a state where nothing else has the name."""
        if name not in self.named:
            self.named[name] = self.graph.input(name, CHANGING)
        return self.named[name]

    def let(self, name: str, value: Value) -> Value:
        """Give a value a name."""
        self.named[name] = self.graph.value(value)
        return self.named[name]

    def add_state(self, name: str, rate: Value, scale: float | None) -> None:
        """Add a state by its rate, and what an error of it is counted against."""
        self.states.append(State(name, self[name], self.graph.value(rate), scale))

    def add_switch(self, name: str, value: Value, overshoot: float, turning: bool = False) -> None:
        """Add a value at whose zero steps end; all states must have been added."""
        self.switches.append(Switch(name, value, self._slope(value), overshoot, turning))

    def rate_of(self, value: Value) -> Value:
        """Rate of a state."""
        return next(state.rate for state in self.states if state.value is value)

    def _slope(self, value: Value) -> Value:
        """Time derivative of a value."""
        slopes = derivative(value, [state.value for state in self.states])
        rate = self.graph.constant(0.0)
        for slope, state in zip(slopes, self.states, strict=True):
            if slope is not None:
                rate = rate + slope * state.rate
        return rate
