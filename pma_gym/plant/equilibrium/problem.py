"""The equilibrium problem of many plants of one structure: their present states and rates."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from pma_gym.effects.effect import Effect


class CompiledEquations(Protocol):
    """Compiled functions of equations of motion; see `pma_gym.plant.program.Program`."""

    derivative: Callable
    observe: Callable
    balance: Callable

    @property
    def offsets(self) -> Mapping[str, int]:
        """Position of every number in a vector of parameters."""
        ...


class SolvablePlant(Protocol):
    """Interface of a compiled model that an equilibrium problem needs."""

    vector: np.ndarray

    @property
    def states(self) -> Sequence[str]:
        """Names of the states, in the order of the state vector."""
        ...

    @property
    def outputs(self) -> Sequence[str]:
        """Names of the true outputs."""
        ...

    @property
    def effects(self) -> Mapping[str, Effect]:
        """The model's effects by name."""
        ...

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The effects' parameters (named tuples) by name."""
        ...

    @property
    def program(self) -> CompiledEquations:
        """The compiled functions."""
        ...

    def derivative(
        self,
        state: np.ndarray,
        motor_voltage: float,
        regulator_voltage: float,
        zero_contraction: float,
    ) -> np.ndarray:
        """Time derivative of the state vector (SI per s)."""
        ...


class EquilibriumProblem:
    """Iterated states of many plants; x0 is 0 until it is known.

    Attributes:
        plant: one of the plants.
        names: index of each state by name.
        vectors: parameters of each plant, shape (n, numbers); None for the parameters of `plant`.
        inputs: motor and regulator command (V) and x0 (m), shape (n, 3).
        state: the states (SI), shape (n, states).
        unbalanced: reason why there is no equilibrium; empty if there is one.
    """

    def __init__(
        self,
        plant: SolvablePlant,
        motor: np.ndarray,
        regulator: np.ndarray,
        vectors: np.ndarray | None,
    ) -> None:
        self.plant = plant
        self.names = {name: i for i, name in enumerate(plant.states)}
        self.vectors = None if vectors is None else np.ascontiguousarray(vectors, float)
        self.inputs = np.stack([motor, regulator, np.zeros(len(motor))], axis=1).astype(float)
        self.state = np.zeros((len(motor), len(self.names)))
        numbers = plant.vector if self.vectors is None else self.vectors
        self._stride = 0 if self.vectors is None else self.vectors.shape[1]
        # A solution takes thousands of rates: looking its addresses up takes as long as they do.
        self._state_at, self._numbers_at = self.state.ctypes.data, numbers.ctypes.data
        self._numbers = numbers
        self._columns: dict[str, dict[str, np.ndarray]] = {}
        self.unbalanced = ""
        put_memories(plant, self.vectors, self.state)

    @property
    def zero(self) -> np.ndarray:
        """Contractions x0 (m), shape (n,), as a writable view."""
        return self.inputs[:, 2]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.state[:, self.names[name]]

    def __setitem__(self, name: str, value: np.ndarray | float) -> None:
        self.state[:, self.names[name]] = value

    def rate(self, name: str, zero: np.ndarray | None = None) -> np.ndarray:
        """Rate of a state, shape (n,)."""
        inputs = self.inputs
        if zero is not None:
            inputs = inputs.copy()
            inputs[:, 2] = zero
        out = np.empty_like(self.state)
        commands, at = inputs.ctypes.data, out.ctypes.data
        arguments = self._state_at, commands, self._numbers_at, self._stride
        self.plant.program.derivative(len(out), *arguments, at)
        return out[:, self.names[name]]

    def output(self, name: str) -> np.ndarray:
        """A true output at the present states with x0 = 0, shape (n,)."""
        plant, truth = self.plant, np.empty((len(self.state), len(self.plant.outputs)))
        for i, (state, out) in enumerate(zip(self.state, truth, strict=True)):
            numbers = plant.vector if self.vectors is None else self.vectors[i]
            addresses = (a.ctypes.data for a in (numbers, out))
            plant.program.observe(1, state.ctypes.data, 0.0, *addresses)
        return truth[:, list(plant.outputs).index(name)]

    def relax(self, name: str, of: str = "", about: np.ndarray | float = 0.0) -> None:
        """Set a state to the zero of a rate that is linear in it `about` a value.

        The rate is the state's own, or that `of` another state.
        """
        rates = []
        for value in (0.0, 1.0):
            self[name] = about + value
            rates.append(self.rate(of or name))
        slope = rates[1] - rates[0]
        self[name] = about - rates[0] / slope
        # From there again: the difference above has lost digits, and a rate may have a kink.
        for _ in range(3):
            self[name] -= self.rate(of or name) / slope

    def follow(self, name: str, rate: np.ndarray) -> None:
        """Set a state at rest to the value at which its linear rate equals `rate`."""
        still, rest = self.rate(name), self[name].copy()
        self[name] = rest + 1.0
        self[name] = rest + rate / (self.rate(name) - still)

    def relax_memory(self, port: str) -> None:
        """Set the state of the command-following effect at a port to its steady value."""
        for effect in self.plant.effects.values():
            if effect.port == port and effect.memories > 1:
                self._relax_together(effect.memory_names)
            elif effect.port == port and effect.rate:
                self.relax(effect.memory_names[0])

    def _relax_together(self, names: Sequence[str]) -> None:
        """Put states where their rates vanish, which are linear in them."""
        for name in names:
            self[name] = 0.0
        slopes = self.slopes(names)
        # From there again: the differences above have lost digits.
        for _ in range(4):
            change = np.linalg.solve(slopes, self._rates(names)[..., None])[..., 0]
            for i, name in enumerate(names):
                self[name] -= change[:, i]

    def slopes(self, names: Sequence[str]) -> np.ndarray:
        """Slopes of the rates of states over the same states, shape (n, rates, states)."""
        still = self._rates(names)
        slopes = np.empty((len(still), len(names), len(names)))
        for i, name in enumerate(names):
            before = self[name].copy()
            self[name] = before + 1.0
            slopes[:, :, i] = self._rates(names) - still
            self[name] = before
        return slopes

    def _rates(self, names: Sequence[str]) -> np.ndarray:
        return np.stack([self.rate(name) for name in names], axis=1)

    def parameters(self, effect: str) -> dict[str, np.ndarray]:
        """An effect's parameters, one per plant or one for all."""
        if effect not in self._columns:
            self._columns[effect] = effect_parameters(self.plant, self.vectors, effect)
        return self._columns[effect]

    def force(self, contraction: np.ndarray) -> np.ndarray:
        """Force of the muscle (N) at a contraction (m), without the cable, shape (n,)."""
        # With the zero at the contraction itself the cable is slack.
        self["contraction"] = contraction
        return self.parameters("slide")["mass"] * self.rate("velocity", zero=contraction)


def put_memories(plant: SolvablePlant, vectors: np.ndarray | None, state: np.ndarray) -> None:
    """Set the effects' states to their initial values; other entries stay unchanged.

    Args:
        plant: one of the plants.
        vectors: parameters of each plant, shape (n, numbers); None for the parameters of `plant`.
        state: the states, shape (n, states), changed in place.
    """
    for effect in plant.effects.values():
        if effect.memory_start:
            memory = effect_parameters(plant, vectors, effect.name)[effect.memory_start]
            for name in effect.memory_names:
                state[:, plant.states.index(name)] = memory


def effect_parameters(
    plant: SolvablePlant, vectors: np.ndarray | None, effect: str
) -> dict[str, np.ndarray]:
    """An effect's parameters, one per plant or one for all."""
    numbers = plant.vector[None, :] if vectors is None else vectors
    fields, offsets = plant.parameters[effect]._fields, plant.program.offsets
    return {field: numbers[:, offsets[f"{effect}.{field}"]] for field in fields}
