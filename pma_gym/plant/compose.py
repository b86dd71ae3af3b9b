"""A plant's equations of motion while they are being put together from the laws of its effects.

A plant (`station.py`, `cascade.py`) says which ports it has and how their results balance; the
effects that a model has fill the ports. What comes out is traced arithmetic, from which compiled
code, Python text and derivatives are made.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pma_gym.effects import Effect
from pma_gym.effects.effect import Parameters, signals
from pma_gym.kernels.derivative import derivative
from pma_gym.kernels.graph import CHANGING, FIXED, HELD, Graph, Value
from pma_gym.kernels.trace import trace

COMMANDS = ("motor_voltage", "regulator_voltage")
"""What a plant is told (V)."""

LAG_SHARE = 5.0
"""Tolerance of a sensor's lag beside that of its output, which it follows where that is slow."""

ZERO = "zero_contraction"
"""Name of the contraction x0 at which a trial began with no load (m)."""


@dataclass(frozen=True)
class Port:
    """A place where effects act on a plant.

    Attributes:
        result: what the effects there contribute, and what becomes of it.
        least: fewest effects that it takes.
        most: most effects that it takes.
        only: names of the effects that it takes; any of this port if empty.
    """

    result: str
    least: int = 0
    most: float = math.inf
    only: tuple[str, ...] = ()

    @property
    def takes(self) -> str:
        """How many effects it takes, or which, in words."""
        if self.only:
            return " and ".join(self.only)
        if self.most == 1:
            return "exactly one effect" if self.least else "at most one effect"
        return f"{self.least} or more effects"


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
        effects: the model's effects by name.
        parameters: their parameters by name; only how many there are matters here.
        ramped: commands change linearly in time; else they are held.

    Attributes:
        graph: the graph of all values.
        effects: the model's effects by name.
        parameters: the effects' parameters by name, as values.
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

    def __init__(
        self,
        effects: Mapping[str, Effect],
        parameters: Mapping[str, Parameters],
        ramped: bool = False,
    ) -> None:
        self.graph = Graph()
        self.effects = dict(effects)
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

    def at(self, port: str) -> list[Effect]:
        """The model's effects at a port, in catalogue order."""
        return [effect for effect in self.effects.values() if effect.port == port]

    def call(self, effect: Effect, law: Callable, **other: Value) -> Any:  # noqa: ANN401
        """What a law returns; `other` gives a signal another value."""
        own = {"p": self.parameters[effect.name], **other}

        def signal(name: str) -> Value:
            if name in own:
                return own[name]
            if name == "memory":
                return self.memory(effect)
            return self[name]

        return trace(law, *(signal(name) for name in signals(law)))

    def memory(self, effect: Effect) -> Any:  # noqa: ANN401
        """The memory of an effect; one of the way travelled, as far as the step has come."""
        if effect.path is None:
            values = tuple(self[name] for name in effect.memory_names)
            return values if effect.memories > 1 else values[0]
        (name,) = effect.memory_names
        for path in self.paths:
            if path.name == name:
                return path.after
        assert self.travelled is not None
        start, parameters = self[name], self.parameters[effect.name]
        direction = self["direction"]
        self.travel = self.travelled[0] - self["origin"]
        after = trace(effect.path, start, self.travel, direction, parameters)
        self.paths.append(Path(name, start, after, effect.memory_scale))
        if effect.path_bend:
            self.ways.append(trace(effect.path_bend, start, direction, parameters))
        return after

    def let(self, name: str, value: Value) -> Value:
        """Give a value a name."""
        self.named[name] = self.graph.value(value)
        return self.named[name]

    def total(self, port: str) -> Value:
        """The sum over the effects at a port."""
        terms: list[Value] = [
            self.call(effect, effect.law) for effect in self.at(port) if effect.law
        ]
        return sum(terms[1:], terms[0]) if terms else self.graph.constant(0.0)

    def product(self, port: str) -> Value:
        """The product over the effects at a port."""
        factor = self.graph.constant(1.0)
        for effect in self.at(port):
            if effect.law:
                factor = factor * self.call(effect, effect.law)
        return factor

    def chain(self, port: str, name: str, value: Value) -> Value:
        """A value that the effects at a port change one after the other, in catalogue order.

        Args:
            port: the port.
            name: the signal by which their laws know the value.
            value: the value before them.
        """
        for effect in self.at(port):
            if effect.law:
                value = self.call(effect, effect.law, **{name: value})
        return value

    def one(self, port: str, **other: Value) -> Any:  # noqa: ANN401
        """What the law of the only effect at a port returns."""
        (effect,) = self.at(port)
        assert effect.law is not None
        return self.call(effect, effect.law, **other)

    def passed(self, port: str, name: str) -> Value:
        """A named value as the effect at a port passes it on; as it is if there is none."""
        return self.one(port) if self.at(port) else self[name]

    def add_state(self, name: str, rate: Value, scale: float | None) -> None:
        """Add a state by its rate, and what an error of it is counted against."""
        self.states.append(State(name, self[name], self.graph.value(rate), scale))

    def add_decaying(
        self, name: str, rate: tuple[Value, Value], scale: float | None, beside: str = ""
    ) -> None:
        """Add a state whose rate law returns (source, decay), and rates of a port `beside` it."""
        source, decay = rate
        self.add_state(name, source - decay * self[name] + self.total(beside), scale)

    def add_memories(self, ports: Sequence[str]) -> None:
        """Add the memory of every effect that has one at these ports."""
        for effect in self.effects.values():
            if effect.port in ports and effect.rate:
                self._add_memory(effect, effect.rate)

    def _add_memory(self, effect: Effect, law: Callable) -> None:
        found = self.call(effect, law)
        rates = found if effect.memories > 1 else (found,)
        for name, rate in zip(effect.memory_names, rates, strict=True):
            self.add_decaying(name, rate, effect.memory_scale)

    def add_switch(self, name: str, value: Value, overshoot: float, turning: bool = False) -> None:
        """Add a value at whose zero steps end; all states must have been added."""
        self.switches.append(Switch(name, value, self._slope(value), overshoot, turning))

    def add_bends(self) -> None:
        """Add the bends of the effects' laws; all states must have been added."""
        for effect in self.effects.values():
            if effect.bend:
                value = self.call(effect, effect.bend)
                self.bends.append(Bend(value, self._slope(value)))

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

    def add_sensors(self, scales: Mapping[str, float]) -> None:
        """Add the lag of every sensor, by what an error of its output is counted against.

        It follows its output, and whatever errors stand at the same port, with their memories.
        """
        for effect in self.effects.values():
            if effect.port.startswith("sensor:") and effect.rate and not effect.law:
                output = effect.port.removeprefix("sensor:")
                truth = self.outputs[output]
                errors = [
                    self.call(error, error.law, signal=truth)
                    for error in self.at(effect.port)
                    if error.law
                ]
                rate = self.call(effect, effect.rate, signal=sum(errors, truth))
                self.add_decaying(f"lag_{effect.name}", rate, LAG_SHARE * scales[output])
                for error in self.at(effect.port):
                    if error.law and error.rate:
                        self._add_memory(error, error.rate)
