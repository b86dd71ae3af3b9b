"""The muscle of a nominal plant alone, at a prescribed motion; the inverses use it."""

import math

import numpy as np

from pma_gym.plant.condition import Condition
from pma_gym.plant.plant import Plant


class Muscle:
    """The muscle of a plant alone, at a prescribed motion.

    Args:
        plant: the plant.
        rest: where it begins, at rest.
    """

    def __init__(self, plant: Plant, rest: Condition) -> None:
        self.plant = plant
        self.state = rest.state.astype(float)
        self.zero = rest.zero_contraction
        self.mass = plant.model.parameters["slide"].mass
        states = plant.states
        self._x, self._v = states.index("contraction"), states.index("velocity")
        self._pressure = states.index("pressure")
        self.state[states.index("angle")] = 0.0
        effects = plant.model.effects
        # Memories of the way travelled are known exactly after it; the others have rates.
        self._paths = {
            states.index(f"memory_{name}"): (
                effect.rate_independent_law,
                plant.model.parameters[name],
            )
            for name, effect in effects.items()
            if effect.rate_independent_law
        }
        memories = (i for i, name in enumerate(states) if name.startswith("memory_"))
        self._memories = [i for i in memories if i not in self._paths]
        self._inputs, self._out = np.zeros(3), np.zeros(len(states))
        # As `Plant.derivative`, whose arrays made anew would cost five times the equations.
        arrays = (self.state, self._inputs, plant.vector)
        self._arguments = (1, *(a.ctypes.data for a in arrays), 0, self._out.ctypes.data)

    def _rates(self) -> np.ndarray:
        """Rates of the state; the array is written over by the next call."""
        # With the zero at the contraction itself, and at angle 0, the cable is untensioned.
        self._inputs[2] = self.state[self._x]
        self.plant.program.derivative(*self._arguments)
        return self._out

    def tension(self, extension: float, speed: float) -> float:
        """Tension (N) that holds an extension (m) moving at a constant speed y' (m/s)."""
        self.state[self._x], self.state[self._v] = self.zero - extension, -speed
        return float(self.mass * self._rates()[self._v])

    def tension_at(self, pressure: float, extension: float, speed: float) -> float:
        """As `tension` (N), at another gauge pressure (Pa), which the muscle then keeps."""
        self.state[self._pressure] = pressure
        return self.tension(extension, speed)

    def remember(self, extension: float, speed: float, duration: float) -> None:
        """Let the memories go on for a while (s) at an extension (m) and speed y' (m/s).

        Exponential Rosenbrock-Euler for those that have rates.
        """
        self.state[self._x], self.state[self._v] = self.zero - extension, -speed
        rates = self._rates().copy()
        after = {}
        for at in self._memories:
            value, change = self.state[at], 1e-6 * (1.0 + abs(self.state[at]))
            self.state[at] = value - math.copysign(change, value)
            slope = (self._rates()[at] - rates[at]) / (self.state[at] - value)
            self.state[at] = value
            turn = slope * duration
            share = math.expm1(turn) / turn if abs(turn) > 1e-9 else 1.0
            after[at] = value + duration * share * rates[at]
        travel = -speed * duration
        for at, (path, parameters) in self._paths.items():
            direction = 1.0 if travel > 0.0 else -1.0
            after[at] = path(float(self.state[at]), travel, direction, parameters)
        for at, value in after.items():
            self.state[at] = value
