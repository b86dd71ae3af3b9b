"""The compiled control step of any rig."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from llvmlite import ir

from pma_gym.codegen.generic import to_real, where
from pma_gym.codegen.graph import HELD, Value
from pma_gym.codegen.machine.control import Builder, Operand
from pma_gym.engine.cpu.step_writer import Writer
from pma_gym.engine.engine_memory import Kernel
from pma_gym.engine.graph.control_step_graph import ControlStepGraph
from pma_gym.engine.rig.layout import RigLayout
from pma_gym.engine.state_layout import NOISE
from pma_gym.integrator.equations import COMMANDS
from pma_gym.plant.composition import PlantEquations

LARGEST = 1e9
"""Bound (SI) of a signal without bounds of its own: beyond, a rig has run away."""


class PushedEquations(PlantEquations):
    """A rig's equations with a force from outside at one port."""

    def __init__(self, port: str, *model: Any) -> None:  # noqa: ANN401 - as the base class
        super().__init__(*model)
        self._port = port

    def total(self, port: str) -> Value:
        """Sum over the effects at a port, and the force from outside."""
        total = super().total(port)
        return total + self.graph.input("push", HELD) if port == self._port else total


class RigStep(ControlStepGraph):
    """Traced parts of a control step of any rig."""

    state_layout: RigLayout

    def slot(self, name: str) -> Value:
        """A number of the record, as an input."""
        return self.graph.input(name, HELD) if name == "push" else super().slot(name)

    def asked(self, i: int, action: Value) -> Value:
        """Input of the equations that an entry of an action asks for."""
        command = self.state_layout.commands[i]
        return command.low + 0.5 * (command.high - command.low) * (action + 1.0)

    def received(self, volts: list[Value]) -> dict[str, Value]:
        """Inputs of the equations for those that have arrived; others stay."""
        here = {name: self.slot(name) for name in COMMANDS}
        commands = self.state_layout.commands
        return here | {c.place: value for c, value in zip(commands, volts, strict=True)}

    def pushed(self) -> Value:
        """Force from outside in the step that begins (N, N m)."""
        return self.slot("load_at_rest") + super().pushed()

    @property
    def followed(self) -> Value:
        """The task's signal within a step attempt (SI)."""
        return self.equations.outputs[self.state_layout.task.schedule.quantity]

    def position(self, sensed: Mapping[str, Value]) -> Value:
        """True value of the task's signal (SI)."""
        return sensed[f"true_{self.state_layout.task.schedule.quantity}"]

    def first_score(self, sensed: Mapping[str, Value]) -> dict[str, Value]:
        """The score's numbers once the first sample, that of the beginning, is taken."""
        error = self.position(sensed) - self.reference(0)
        return {"sample": self.graph.constant(1.0), "sum_whole": error * error}

    def sense(self, count: Value, first: bool) -> dict[str, Value]:
        """Compute measurement, end and info from the plant's state: new numbers by name."""
        layout, truth = self.state_layout, self.truth()
        reading = dict(zip(layout.parts, self.read(NOISE, count), strict=True))
        new: dict[str, Value] = {f"true_{name}": value for name, value in truth.items()}
        for k in range(layout.readings):
            for part in layout.parts:
                before = reading[part] if k == 0 or first else self.slot(f"{part}_{k - 1}")
                new[f"{part}_{k}"] = before
        new["ended"] = self._ended(truth)
        new["count"] = count
        return new | self._info(new, to_real(count))

    def _ended(self, truth: Mapping[str, Value]) -> Value:
        """Number of the first signal beyond its bounds, from 1 on; 0 for none."""
        code = self.graph.constant(0.0)
        for i, signal in reversed(list(enumerate(self.state_layout.options.outputs, 1))):
            low, high = self.state_layout.options.bounds.get(signal.name, (-LARGEST, LARGEST))
            value = truth[signal.name]
            # What is no number is within no bounds.
            code = where((value >= low) & (value <= high), code, float(i))
        return code

    def _info(self, sensed: Mapping[str, Value], count: Value) -> dict[str, Value]:
        layout = self.state_layout
        late = layout.options.observation_delay
        values = [
            count * layout.options.period,
            *(sensed[f"true_{signal.name}"] for signal in layout.options.outputs),
            *(sensed[f"{part}_{late}"] for part in layout.parts),
            self.reference(0),
            self.position(sensed) - self.reference(0),
            *(
                command.gain * self.slot(command.place) + command.offset
                for command in layout.commands
            ),
            self.slot("push"),
        ]
        return dict(zip(layout.info, values, strict=True))


class RigWriter(Writer):
    """Writes a kernel's module; sensors of a rig keep the zero that they have."""

    def _zero_sensors(self, b: Builder, records: Operand, tables: Operand, lane: Operand) -> None:
        """Leave the sensors as they are."""


class RigKernel(Kernel):
    """The compiled functions of environments of one rig's structure and one set of options."""

    graph_type: type[ControlStepGraph] = RigStep
    state_layout: RigLayout

    @property
    def equations_type(self) -> Callable[..., PlantEquations]:  # type: ignore[override]
        """What makes the rig's equations."""
        rig = self.program.model.rig
        pushed = self.state_layout.options.is_pushed
        return partial(PushedEquations, rig.push_port) if pushed else PlantEquations

    def _module(self) -> ir.Module:
        return RigWriter(self).module

    def _draws(self) -> bool:
        return False

    def _key(self) -> list[str]:
        layout = self.state_layout
        options = layout.options
        own = [(c.place, c.gain, c.offset, c.low, c.high) for c in layout.commands]
        bounds = sorted(options.bounds.items())
        return ["rig", *super()._key(), str(own), str(bounds), str(options.is_pushed)]
