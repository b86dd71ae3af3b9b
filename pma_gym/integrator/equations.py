"""A plant's right-hand side as traced arithmetic: states, rates, memories, events.

What writes it (`pma_gym.plant.composition`) is no concern of the integrator, which reads states,
rates and events from here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pma_gym.codegen.derivative import derivative
from pma_gym.codegen.graph import CHANGING, FIXED, HELD, Graph, Value
from pma_gym.effects.effect import Parameters

Interpolation = Literal["foh", "zoh"]
"""Commands between two rows: first-order hold (linear in time) or zero-order hold (constant)."""

COMMANDS = ("motor_voltage", "regulator_voltage")
"""Commands of a plant (V)."""

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
class RateIndependentState:
    """A rate-independent state: it depends on the distance travelled, not on time.

    Attributes:
        name: its name.
        value: the memory where the step began.
        after: the memory after the distance since then.
        scale: what an error of it is counted against.
    """

    name: str
    value: Value
    after: Value
    scale: float


@dataclass(frozen=True)
class Event:
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
class Breakpoint:
    """A value at whose zero a law changes form: a step ends near it.

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
        interpolation: of the commands between rows: "foh" (first-order hold, linear in time) or
            "zoh" (zero-order hold).
        graph: the graph to write into, a new one by default.

    Attributes:
        graph: the graph of all values.
        parameters: the effects' parameters by name, as values.
        interpolation: of the commands.
        named: values by name: states, commands, and whatever else has been given a name.
        states: the states that have rates, in the order of the state vector.
        rate_independent_states: memories of the distance travelled, which come after the states.
        events: event functions at whose zeros steps end.
        breakpoints: values near whose zeros steps end.
        path_breakpoints: how far a step may travel before a rate-independent law changes form (m),
            by what holds where the step begins.
        outputs: true outputs by name.
        readings: what sensors read of them besides noise, by the output's name.
        travelled: the state whose distance they depend on, and its rate.
        travel: its distance since the step began; None where no law depends on it.
    """

    def __init__(
        self,
        parameters: Mapping[str, Parameters],
        interpolation: Interpolation = "zoh",
        graph: Graph | None = None,
    ) -> None:
        self.graph = graph or Graph()
        self.parameters = {
            name: self.graph.inputs(name, values, FIXED) for name, values in parameters.items()
        }
        command = CHANGING if interpolation == "foh" else HELD
        self.interpolation = interpolation
        self.named: dict[str, Value] = {
            ZERO: self.graph.input(ZERO, HELD),
            **{name: self.graph.input(name, command) for name in COMMANDS},
        }
        self.states: list[State] = []
        self.rate_independent_states: list[RateIndependentState] = []
        self.events: list[Event] = []
        self.breakpoints: list[Breakpoint] = []
        self.path_breakpoints: list[Value] = []
        self.travelled: tuple[Value, Value] | None = None
        self.travel: Value | None = None
        self.outputs: dict[str, Value] = {}
        self.readings: dict[str, Value] = {}

    def finish(self) -> None:
        """Add the commands as states of constant rate, for a first-order hold."""
        for name in COMMANDS if self.interpolation == "foh" else ():
            self.add_state(name, self.graph.input(f"{name}_slope", HELD), None)

    @property
    def remembered(self) -> list[State | RateIndependentState]:
        """States and memories, without commands: the state vector."""
        by_rate = [state for state in self.states if state.name not in COMMANDS]
        return [*by_rate, *self.rate_independent_states]

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

    def add_event(self, name: str, value: Value, overshoot: float, turning: bool = False) -> None:
        """Add a value at whose zero steps end; all states must have been added."""
        self.events.append(Event(name, value, self._slope(value), overshoot, turning))

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


def check_interpolation(interpolation: str) -> None:
    """Reject an unknown interpolation of commands.

    Raises:
        ValueError: it is unknown; the message lists the choices.
    """
    if interpolation not in ("foh", "zoh"):
        raise ValueError(
            "interpolation must be 'foh' (commands linear in time between rows) or 'zoh' (each "
            f"held until the next row), got {interpolation!r}"
        )
