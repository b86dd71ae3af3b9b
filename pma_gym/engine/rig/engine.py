"""The class `RigEngine`: environments of any rig as arrays, stepped together."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pma_gym.engine.actions import CommandLine
from pma_gym.engine.engine import Engine
from pma_gym.engine.option_checks import Pressure
from pma_gym.engine.options import Options
from pma_gym.engine.rig.layout import RigLayout, RigObservation
from pma_gym.engine.rig.options import RigOptions, draw_rig_task, starts
from pma_gym.engine.rig.step import RigKernel
from pma_gym.integrator.equations import COMMANDS
from pma_gym.plant.commands import Command
from pma_gym.plant.equilibrium.solver import equilibria_at
from pma_gym.plant.model import Model
from pma_gym.plant.program import FIRST_S
from pma_gym.tasks import Task


class RigCommands(CommandLine):
    """Action space of a rig's agent, and conversion of commands to actions."""

    def __init__(self, options: RigOptions) -> None:
        """Set the size of the action space."""
        self.commands = options.commands
        self._size = len(self.commands)
        self.space = self._box(self._size)

    def begin(self, regulator_voltage: float) -> None:
        """Start a trial; nothing depends on it."""

    def action_of(self, values: Sequence[float]) -> NDArray[np.float64]:
        """Return the action for commands (SI), within their limits."""
        return np.array([action_at(*pair) for pair in zip(self.commands, values, strict=True)])

    def _rule(self) -> str:
        names = ", ".join(command.signal.name for command in self.commands)
        return f"action must have shape ({self._size},): {names}, each -1 to 1"


def action_at(command: Command, value: float) -> float:
    """Entry of an action for a command (SI), -1 to 1."""
    return 2.0 * (command.at(value) - command.low) / (command.high - command.low) - 1.0


class RigEngine(Engine):
    """Hold the state of n environments of any rig and step them; see `Engine`."""

    layout_type, table_type, kernel_type = RigLayout, RigObservation, RigKernel
    options: RigOptions
    state_layout: RigLayout

    def _rig_model(self, options: Options) -> Model:
        return options.nominal

    @cached_property
    def _starts(self) -> dict[str, float]:
        return starts(self.options)

    def _drawn_task(self, generator: np.random.Generator) -> Task:
        reference = self.options.reference
        return draw_rig_task(self.task, reference, generator, self.options, self._starts)

    def limit_in_words(self, index: int, code: float) -> str:
        """Name of the bound that ended an environment's episode; "" for a code of 0."""
        if not code:
            return ""
        signal = self.options.outputs[int(code) - 1]
        low, high = self.options.bounds.get(signal.name, (-np.inf, np.inf))
        return f"{signal.name} beyond {low:g} to {high:g} {signal.si_unit}"

    def _begin_drawn(self, indices: NDArray[np.int64], asked: Sequence[Pressure]) -> None:
        """Write down where rigs begin."""
        vectors, rest = self._drawn_models(indices), self.options.resting()
        if vectors is None:
            vectors = self.nominal.vector[None, :]
        motor, regulator = (np.full(len(vectors), rest.get(name, 0.0)) for name in COMMANDS)
        states, zero = equilibria_at(self.nominal, motor, regulator, vectors)
        if np.isnan(states).any() or np.isnan(zero).any():
            raise ValueError(
                f"a drawn rig of model {self.nominal.model.name} has no equilibrium at the "
                f"commands of rest: {self.options.rest}; give others by the option rest"
            )
        self._write(indices, states, zero)

    def _write(
        self, indices: NDArray[np.int64], states: NDArray[np.float64], zero: NDArray[np.float64]
    ) -> None:
        offsets, rest = self.state_layout.offsets, self.options.resting()
        rows = np.zeros((len(indices), self.state_layout.size))
        wholes = rows.view(np.int64)

        def put(name: str, values: ArrayLike) -> None:
            rows[:, offsets[name]] = values

        rows[:, : states.shape[1]] = states
        put("size", FIRST_S)
        put("zero_contraction", zero)
        for i in range(2):
            wholes[:, offsets[f"key_{i}"]] = self._keys[indices, i]
        wholes[:, offsets["episode"]] = self._episodes[indices]
        for i, command in enumerate(self.state_layout.commands):
            held = rest[command.place]
            put(command.place, held)
            put(f"action_{i}", action_at(command, command.gain * held + command.offset))
            for k in range(self.options.action_delay):
                put(f"wire_{k}_{i}", held)
        low, high = self.options.loads
        if low != high:
            loads = [self._generator(i, 2).uniform(low, high) for i in indices.tolist()]
        else:
            loads = low
        for name in ("load_at_rest", "push"):
            put(name, loads)
        if self.state_layout.events:
            self._put_events(indices, put)
        block, lane = np.divmod(indices, self.width)
        self.records[block, :, lane] = rows
