"""Assembly of a plant's equations of motion from the laws of its effects.

A rig (`station.py`, `cascade.py`) defines its ports and how their results balance; the model's
effects fill the ports. The result is a traced expression graph, the source of compiled code, Python
text and derivatives.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pma_gym.codegen.generic import where
from pma_gym.codegen.graph import CHANGING, Graph, Value
from pma_gym.codegen.trace import trace
from pma_gym.effects import Effect
from pma_gym.effects.arithmetic import positive
from pma_gym.effects.effect import Parameters, signals
from pma_gym.effects.ports import MOUNT, SENSOR_DELAY
from pma_gym.integrator.equations import Breakpoint, Equations, Interpolation, RateIndependentState

LAG_SHARE = 5.0
"""Tolerance of a sensor's lag relative to that of its output."""


class PlantEquations(Equations):
    """The right-hand side of a plant, assembled from the laws of its effects.

    Args:
        effects: the model's effects by name.
        parameters: their parameters by effect; only their number matters here.
        interpolation: of the commands between rows: "foh" (linear in time) or "zoh" (held).
        graph: the graph to write into, a new one by default.

    Attributes:
        effects: the model's effects by name.
        views: values that laws read under the name of a signal in place of it, keyed by the port of
            their effects: those of the muscle that has the port. With `travel`, `direction` and
            `arm` (per travel of the rig) a memory counts the muscle's way.
    """

    def __init__(
        self,
        effects: Mapping[str, Effect],
        parameters: Mapping[str, Parameters],
        interpolation: Interpolation = "zoh",
        graph: Graph | None = None,
    ) -> None:
        super().__init__(parameters, interpolation, graph)
        self.effects = dict(effects)
        self.views: dict[str, dict[str, Value]] = {}

    def at(self, port: str) -> list[Effect]:
        """The model's effects at a port, in catalogue order."""
        return [effect for effect in self.effects.values() if effect.port == port]

    def call(self, effect: Effect, law: Callable, **other: Value) -> Any:  # noqa: ANN401
        """Return the value of a law; `other` replaces signals by other values."""
        own = {"p": self.parameters[effect.name], **self.views.get(effect.port, {}), **other}

        def signal(name: str) -> Value:
            if name in own:
                return own[name]
            if name == "memory":
                return self.memory(effect)
            return self[name]

        return trace(law, *(signal(name) for name in signals(law)))

    def memory(self, effect: Effect) -> Any:  # noqa: ANN401
        """Return an effect's state; a rate-independent one at the present point of the step."""
        if effect.rate_independent_law is None:
            values = tuple(self[name] for name in effect.memory_names)
            return values if effect.memories > 1 else values[0]
        (name,) = effect.memory_names
        for known in self.rate_independent_states:
            if known.name == name:
                return known.after
        assert self.travelled is not None
        start, parameters = self[name], self.parameters[effect.name]
        direction = self["direction"]
        self.travel = self.travelled[0] - self["origin"]
        view = self.views.get(effect.port, {})
        inputs = {"memory": start, "travel": self._travel_of(effect), "direction": direction}
        inputs |= {name: view[name] for name in inputs.keys() & view.keys()}
        law = effect.rate_independent_law
        after = trace(law, *({**inputs, "p": parameters}[name] for name in signals(law)))
        state = RateIndependentState(name, start, after, effect.memory_scale)
        self.rate_independent_states.append(state)
        if effect.path_breakpoint:
            distance = trace(effect.path_breakpoint, start, inputs["direction"], parameters)
            self.path_breakpoints.append(distance / view["arm"] if "arm" in view else distance)
        return after

    def _travel_of(self, effect: Effect) -> Value:
        """The way that an effect's memory has gone since the step began, less what backlash loses.

        Backlash loses it once what rubs is relaxed: until then the drive is still pushed.
        """
        assert self.travel is not None
        gaps = self.at("lost_motion")
        if effect in gaps:
            direction = self["direction"]
            left = direction * self.travel - self._release(direction)
            return direction * trace(positive, left)
        if not effect.release_path:
            return self.travel
        travel = self.travel
        for gap in gaps:
            travel = travel - (self.memory(gap) - self[gap.memory_names[0]])
        return travel

    def _release(self, direction: Value) -> Value:
        """How far the drive moves before nothing that rubs pushes it any more (m)."""
        longest = self.graph.constant(0.0)
        for effect in self.effects.values():
            if effect.release_path:
                start, own = self[effect.memory_names[0]], self.parameters[effect.name]
                way = trace(effect.release_path, start, direction, own)
                longest = where(way > longest, way, longest)
        return longest

    def total(self, port: str) -> Value:
        """Sum over the effects at a port."""
        terms: list[Value] = [
            self.call(effect, effect.law) for effect in self.at(port) if effect.law
        ]
        return sum(terms[1:], terms[0]) if terms else self.graph.constant(0.0)

    def product(self, port: str) -> Value:
        """Product over the effects at a port."""
        factor = self.graph.constant(1.0)
        for effect in self.at(port):
            if effect.law:
                factor = factor * self.call(effect, effect.law)
        return factor

    def chain(self, port: str, name: str, value: Value) -> Value:
        """Apply the effects at a port to a value one after the other, in catalogue order.

        Args:
            port: the port.
            name: the signal that holds the value in their laws.
            value: the value before them.
        """
        for effect in self.at(port):
            if effect.law:
                value = self.call(effect, effect.law, **{name: value})
        return value

    def one(self, port: str, **other: Value) -> Any:  # noqa: ANN401
        """Return the value of the law of the only effect at a port."""
        (effect,) = self.at(port)
        assert effect.law is not None
        return self.call(effect, effect.law, **other)

    def passed(self, port: str, name: str) -> Value:
        """Return a value after the effect at a port; unchanged if there is none."""
        return self.one(port) if self.at(port) else self[name]

    def add_decaying(
        self, name: str, rate: tuple[Value, Value], scale: float | None, beside: str = ""
    ) -> None:
        """Add a state whose rate law returns (source, decay), and rates of a port `beside` it."""
        source, decay = rate
        self.add_state(name, source - decay * self[name] + self.total(beside), scale)

    def add_memories(self, ports: Sequence[str], scales: Mapping[str, float] | None = None) -> None:
        """Add the states of the effects at these ports.

        Args:
            ports: the ports.
            scales: error scale of the states by port, where it differs from the effect's scale.
        """
        for effect in self.effects.values():
            if effect.port in ports and effect.rate:
                scale = (scales or {}).get(effect.port, effect.memory_scale)
                self._add_memory(effect, effect.rate, scale)

    def _add_memory(self, effect: Effect, law: Callable, scale: float, **other: Value) -> None:
        pairs = self.call(effect, law, **other)
        rates = pairs if effect.memories > 1 else (pairs,)
        for name, rate in zip(effect.memory_names, rates, strict=True):
            self.add_decaying(name, rate, scale)

    def add_breakpoints(self) -> None:
        """Add the breakpoints of the effects' laws; all states must have been added."""
        for effect in self.effects.values():
            if effect.breakpoint:
                signals = self.call(effect, effect.breakpoint)
                for signal in signals if isinstance(signals, tuple) else (signals,):
                    value = self.graph.value(signal)
                    # A rig without such a force has no such breakpoint.
                    if value.level == CHANGING:
                        self.breakpoints.append(Breakpoint(value, self._slope(value)))

    def add_sensors(self, scales: Mapping[str, float]) -> None:
        """Add the lag of every sensor, with the error scales of their outputs.

        What its mount makes of the output is read. A lag's input is that plus the errors at the
        sensor's port, late by the sensor's delay; their states are added too.
        """
        self.readings = {output: self._mounted(output) for output in self.outputs}
        for effect in self.effects.values():
            if effect.port.startswith("sensor:") and effect.rate and not effect.law:
                output = effect.port.removeprefix("sensor:")
                truth = self.readings[output]
                errors = [
                    self.call(error, error.law, signal=truth)
                    for error in self.at(effect.port)
                    if error.law
                ]
                scale = LAG_SHARE * scales[output]
                received = self._delayed(output, sum(errors, truth), scale)
                rate = self.call(effect, effect.rate, signal=received)
                self.add_decaying(f"lag_{effect.name}", rate, scale)
                self.readings[output] = self[f"lag_{effect.name}"]
                for error in self.at(effect.port):
                    if error.law and error.rate:
                        self._add_memory(error, error.rate, error.memory_scale)

    def _mounted(self, output: str) -> Value:
        """Return an output with what its sensor's mount adds to it."""
        truth = self.outputs[output]
        added = [
            self.call(each, each.law, signal=truth)
            for each in self.at(f"{MOUNT}{output}")
            if each.law
        ]
        return sum(added, truth)

    def _delayed(self, output: str, signal: Value, scale: float) -> Value:
        """Return an output after the delay of its sensor, whose states are added."""
        for effect in self.at(f"{SENSOR_DELAY}{output}"):
            assert effect.law is not None and effect.rate is not None
            self._add_memory(effect, effect.rate, scale, signal=signal)
            signal = self.call(effect, effect.law, signal=signal)
        return signal
