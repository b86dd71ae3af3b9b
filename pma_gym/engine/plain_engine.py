"""The control step in plain Python, to read and to debug: `PMAEnv(compiled=False)`."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.graph import CHANGING, Number, NumberGraph, Value
from pma_gym.engine.cpu.python_step import NOT_READ
from pma_gym.engine.engine import Engine
from pma_gym.engine.graph.control_step_graph import ControlStepGraph
from pma_gym.engine.graph.scoring import COURSE, course, position_of, sampling
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.forms.plain import Made, PlainPlant
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant


class PlainEngine(Engine):
    """A single environment whose control step Python interprets; resets stay compiled.

    Command, sensors, reward, observation and the plant's equations are the functions that are
    traced for compiled code, called with the numbers of the step: at its beginning, and after every
    attempt of the integration. The attempts are `PlainPlant`'s, whose text has derivatives and
    stages too.

    See `Engine` for arguments and attributes.
    """

    _station: Model | None = None

    @property
    def plain(self) -> PlainPlant:
        """The episode's plant in plain Python, made anew for a drawn station."""
        if self._station is not self.models[0]:
            self._station = self.models[0]
            system = self.nominal.program.zero_order_hold
            eq = system.equations
            position = position_of(eq, self.task, eq.outputs)
            watched = course(eq, system.attempt, position).values
            self._plain = PlainPlant(Plant(self._station, self.nominal.tolerance), watched)
        return self._plain

    def advance(
        self, copy: Callable[[], Any], given: NDArray[np.float64], constants: Mapping[str, Any]
    ) -> Callable[[Any], Any]:
        """Return the step as a function; see `Engine.advance`. It reads no action but `given`."""
        # Laws are traced here: in a step they are called with numbers only.
        self._numbers(0)

        def made(action: object) -> Any:  # noqa: ANN401 - as `Engine.advance` has it
            if action is not given:
                return NOT_READ
            ended = self.step()
            info = {name: self.numbers(name)[0] for name in self.state_layout.info}
            observed = copy(), float(self.rewards[0]), False, False, info | dict(constants)
            return ended or observed

        return made

    def step(self) -> int:
        """Step with `actions`, which are finite; see `Engine.step`."""
        count = self.steps(0)
        self._keep(self._at(count).command())
        self.voltages[count] = self.numbers(f"{self.task.actuator}_voltage")[0]
        step = self._integrated(count)
        sensed = step.sense(step.slot("count") + 1, first=False)
        sensed["reward"] = step.reward(sensed)
        self._keep(sensed)
        entries = step.observation(self.table, sensed)
        self.observations[0] = [entry.data for entry in entries]
        self.rewards[0] = sensed["reward"].data
        self.terminated[0] = ended = bool(sensed["ended"].data)
        self.truncated[0] = at_end = not ended and self.steps(0) >= self.horizon
        return ended + 2 * at_end

    def _numbers(self, count: int) -> dict[str, Number]:
        """Numbers of all inputs by name: of the record, the parameters, the references."""
        numbers: dict[str, Number] = dict(self.plain.parameters)
        for name in self.state_layout.offsets:
            numbers[name] = numbers[f"record.{name}"] = self._stored(name).item()
        for i, action in enumerate(self.actions[0].tolist()):
            numbers[f"action.{i}"] = action
        for k in range(self.options.preview + 1):
            numbers[f"reference.{k}"] = float(self.references(0)[count + 1 + k])
        # No way has been travelled since; at rest the next one may go either way.
        numbers["origin"] = numbers["contraction"]
        numbers["direction"] = -1.0 if numbers["velocity"] < 0.0 else 1.0
        return numbers | {"horizon": float(self.horizon)}

    def _at(self, count: int) -> ControlStepGraph:
        """The parts of the step for the present numbers; calls the laws of the plant's effects."""
        model = self.models[0]
        graph = NumberGraph(self._numbers(count))
        eq = PlantEquations(model.effects, model.parameters, graph=graph)
        model.rig.write_equations(eq)
        return ControlStepGraph(self.state_layout, eq)

    def _keep(self, values: Mapping[str, Value]) -> None:
        """Write what the record has a place for, by name."""
        for name, value in values.items():
            if name in self.state_layout.offsets:
                self._stored(name)[:] = value.data

    def _stored(self, name: str) -> NDArray[Any]:
        """View of a number of the record, shape (1,)."""
        is_integer = self.state_layout.kind(name) == "integer"
        return (self.integers if is_integer else self.records)[0, self.state_layout.offsets[name]]

    def _integrated(self, count: int) -> ControlStepGraph:
        """Integrate over the control step; return the parts of the step at its end."""
        step, left = self._at(count), self.options.period
        row, states = self.records[0, :, 0], len(self.state_layout.states)
        self._attempts[:] = 0
        while left > 0.0:
            made = self.plain.make(self._numbers(count) | {"left": left})
            row[:states], row[self.state_layout.offsets["size"]] = made.state, made.size
            left = made.next_left
            self._attempts[0, 0] += 1
            if made.accepted:
                self._sample(made, count)
                step = self._at(count)
        return step

    def _sample(self, made: Made, count: int) -> None:
        """Take every sample that lies in an attempt."""
        phases, moves = self.task.schedule.phases, self.task.schedule.motion is not None
        names = ["sample", *(f"sum_{phase.name}" for phase in phases)]
        known: dict[str, Number] = {"length": made.length, "accepted": made.accepted}
        known |= {"left": made.left, "clock": count * self.options.period}
        known |= {f"course.{name}": at for name, at in zip(COURSE, made.watched, strict=True)}
        while True:
            known |= {f"record.{name}": float(self.numbers(name)[0]) for name in names}
            sample = int(known["record.sample"])
            ideal = {"ideal": float(self._ideals[0, sample])} if moves else {}
            graph = NumberGraph(known | ideal)
            left = graph.input("left", CHANGING)
            one = sampling(graph, left, self.task, self.options.period)
            if not one.due.data:
                return
            self.trace[sample] = one.position.data
            self._keep(dict(zip(names, [one.sample, *one.sums], strict=True)))
