"""Writes a plant's equations of motion as one Python module, from the texts of its laws.

A plant (`station.py`, `cascade.py`) says which ports it has and how their results balance; the
effects that a model has fill the ports. The result is plain Python text that runs as it stands
(for debugging and for `symbolic`), and that `compiled.py` compiles.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pma_gym.effects import Effect
from pma_gym.effects.effect import signals


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
    """One state of a plant: its name, and what its rate is made of.

    Attributes:
        name: name of the state in the text.
        source: expression of the part of the rate that does not decay.
        decay: expression of the decay rate (1/s), which is integrated exactly; None if none.
    """

    name: str
    source: str
    decay: str | None = None


@dataclass
class Equations:
    """A plant's right-hand side while it is being written.

    Attributes:
        effects: the model's effects by name.
        lines: assignments, in order of evaluation.
        functions: functions that the lines call beside the effects' laws.
        states: the states, in the order of the state vector.
    """

    effects: dict[str, Effect]
    lines: list[str] = field(default_factory=list)
    functions: list[Callable] = field(default_factory=list)
    states: list[State] = field(default_factory=list)

    def at(self, port: str) -> list[Effect]:
        """The model's effects at a port, in catalogue order."""
        return [effect for effect in self.effects.values() if effect.port == port]

    def call(self, effect: Effect, law: Callable, **renamed: str) -> str:
        """The text of a law's call; `renamed` gives a signal another name."""
        own = {"p": f"p_{effect.name}", "memory": f"memory_{effect.name}", **renamed}
        return f"{law.__name__}({', '.join(own.get(name, name) for name in signals(law))})"

    def total(self, port: str) -> str:
        """The text of the sum over the effects at a port."""
        terms = [self.call(effect, effect.law) for effect in self.at(port) if effect.law]
        return " + ".join(terms) or "0.0"

    def product(self, port: str) -> str:
        """The text of the product over the effects at a port."""
        factors = [self.call(effect, effect.law) for effect in self.at(port) if effect.law]
        return " * ".join(factors) or "1.0"

    def let(self, name: str, expression: str) -> None:
        """Add an assignment."""
        self.lines.append(f"{name} = {expression}")

    def one(self, port: str, **renamed: str) -> str:
        """The text of the law of the only effect at a port."""
        (effect,) = self.at(port)
        assert effect.law is not None
        return self.call(effect, effect.law, **renamed)

    def add_state(self, name: str, source: str, decay: str | None = None) -> None:
        """Add a state by the expressions of its source and decay."""
        self.states.append(State(name, source, decay))

    def add_rate(self, name: str, call: str) -> None:
        """Add a state whose rate law returns (source, decay)."""
        self.lines.append(f"source_{name}, decay_{name} = {call}")
        self.states.append(State(name, f"source_{name}", f"decay_{name}"))

    def add_memories(self, ports: Sequence[str]) -> None:
        """Add the memory of every effect that has one at these ports."""
        for effect in self.effects.values():
            if effect.port in ports and effect.rate:
                self.add_rate(f"memory_{effect.name}", self.call(effect, effect.rate))

    def add_sensors(self, stands_on: dict[str, str]) -> None:
        """Add the lag of every sensor; `stands_on` gives the text of the signal it reads."""
        for effect in self.effects.values():
            if effect.port.startswith("sensor:") and effect.rate:
                signal = stands_on[effect.port.removeprefix("sensor:")]
                self.add_rate(f"lag_{effect.name}", self.call(effect, effect.rate, signal=signal))


def parameter_lines(effects: dict[str, Effect], lengths: dict[str, list[int]]) -> list[str]:
    """Text that unpacks the flat parameter vector into one named tuple an effect."""
    lines, at = [], 0
    for name, effect in effects.items():
        fields = []
        for length in lengths[name]:
            items = [f"vector[{i}]" for i in range(at, at + max(length, 1))]
            fields.append(f"({', '.join(items)},)" if length else items[0])
            at += max(length, 1)
        lines.append(f"p_{name} = {effect.parameters.__name__}({', '.join(fields)})")
    return lines


def imports(equations: Equations) -> list[str]:
    """Import lines for the laws and parameter classes that the equations use."""
    names = {(function.__module__, function.__name__) for function in equations.functions}
    for effect in equations.effects.values():
        names.add((effect.parameters.__module__, effect.parameters.__name__))
        names.update((law.__module__, law.__name__) for law in effect.laws())
    return [f"from {module} import {name}" for module, name in sorted(names)]
