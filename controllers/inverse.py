"""A nominal model turned around: the motor voltage that a motion needs.

Station. The muscle's end moves at x = x0 - y, x' = -y'. Its balance of forces says which tension
the cable must have, and the rotor's balance which load the drive must give:

    T = F(P, x, memories) - B x' - m x''
    L = T + (J theta'' + B_M theta') / r,   r theta = y + slack + T / k_c
    V = (L - offset) / gain

F(P, x0 - y) is the static map, B y' the compensation of the muscle's lag tau = B / K. Forces and
the rates of the memories (hysteresis, dry friction) are read off the plant's own equations, so an
effect that a model gains is inverted without a change here. They are followed along the reference
every 2 ms at most; a control period gets the mean of L over it, in which inertia counts as change
of momentum over the period, so corners of the reference need no second derivative.

Cascade. u = y + tau y' (u = r theta in rotation), then the voltage of the static map there.
"""

import math
from collections.abc import Callable

import numpy as np

from controllers.controller import Reference
from pma_gym.effects.position_map import mapped_displacement
from pma_gym.envs import Station
from pma_gym.plant.lanes import lanes
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Condition, Plant

VOLTAGE_LIMIT = 10.0
"""Largest motor voltage (V)."""

STEP_S = 2e-3
"""Longest step along the reference (s); memories are exact to second order in it."""

TAKE_UP_S = 20e-3
"""For how long the rotor is pushed through the slack (s); it then coasts as long again."""

Inverse = Callable[[Reference, Station, int], np.ndarray]
"""Motor voltage (V) of every control period, shape (steps,), by reference, station and steps. Not
held to 0-10 V: beyond it says by how much the motion asks for what the drive cannot give."""


def inverse_of(model: Model) -> Inverse:
    """The inverse of a nominal model."""
    plant = Plant(model)
    return StationInverse(plant) if model.plant == "station" else CascadeInverse(plant)


class StationInverse:
    """Inverse of the station's balances.

    Args:
        plant: the nominal plant.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        parameters = plant.model.parameters
        self.rotor, self.cable, self.drive = (parameters[n] for n in ("rotor", "cable", "drive"))
        self.mass = parameters["slide"].mass
        self.rotor_mass = self.rotor.inertia / self.rotor.radius**2

    def __call__(self, reference: Reference, station: Station, steps: int) -> np.ndarray:
        """Motor voltage (V) of every control period, shape (steps,)."""
        parts = max(1, math.ceil(station.period / STEP_S - 1e-9))
        wanted = np.array([reference(i * station.period / parts) for i in range(steps * parts + 1)])
        rotation = station.task.protocol.quantity == "rotation"
        tension, extension = self.follow(wanted, station.period / parts, station.pressure, rotation)
        wound = self.rotor.radius * wanted if rotation else extension
        load = self._mean_load(tension, extension, wound, station.period, parts)
        if not rotation:
            self._take_up_slack(load, station.period)
        return (load - self.drive.offset) / self.drive.gain

    def follow(
        self, wanted: np.ndarray, step: float, pressure: float, rotation: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tension and extension along a motion.

        Args:
            wanted: extension (m) or rotation (rad) at the nodes, shape (n + 1,).
            step: time between nodes (s).
            pressure: gauge pressure (Pa).
            rotation: whether `wanted` is one.
        Returns:
            Tension without inertia in the steps (N), shape (n,), negative where the cable would
            have to push; extension at the nodes (m), shape (n + 1,).
        """
        muscle = Muscle(self.plant, self.plant.settle(0.0, pressure=pressure))
        tension, extension = np.zeros(len(wanted) - 1), np.zeros(len(wanted))
        for i in range(len(tension)):
            start, target = extension[i], wanted[i + 1]
            if rotation:
                target = self._pulled_to(self.rotor.radius * target, muscle, start, step)
            pull = muscle.tension(0.5 * (target + start), (target - start) / step)
            if pull < 0.0:
                # The cable cannot push: it hangs loose, and the muscle stays where it is.
                target = start
            muscle.remember(0.5 * (target + start), (target - start) / step, step)
            tension[i], extension[i + 1] = pull, target
        return tension, extension

    def _pulled_to(self, wound: float, muscle: "Muscle", start: float, step: float) -> float:
        """Extension (m) to which a cable, wound in so far (m), pulls the muscle in a step.

        y = wound - slack - T / k_c, in which T grows with y and y'. The cable is 20 times as
        stiff as the muscle but the damper over a step is not, so y must be solved for: with a
        secant, T being close to linear over a step.
        """
        taut = wound - self.cable.slack

        def excess(target: float) -> float:
            pull = muscle.tension(0.5 * (target + start), (target - start) / step)
            return target + pull / self.cable.stiffness - taut

        low, high = start, max(taut, start + 1e-6)
        at_low, at_high = excess(low), excess(high)
        return max(0.0, low - at_low * (high - low) / (at_high - at_low))

    def _mean_load(
        self,
        tension: np.ndarray,
        extension: np.ndarray,
        wound: np.ndarray,
        period: float,
        parts: int,
    ) -> np.ndarray:
        """Mean load (N) of every period: tension, friction of the rotor, change of momentum."""
        step = period / parts
        friction = self.rotor.damping / self.rotor.radius**2 * np.diff(wound) / step
        momentum = self.mass * np.diff(extension) + self.rotor_mass * np.diff(wound)
        # Speed just before each period's start: a corner is rounded in the period after it.
        before = np.concatenate([[0.0], momentum[parts - 1 :: parts] / step])
        return (tension + friction).reshape(-1, parts).mean(axis=1) + np.diff(before) / period

    def _take_up_slack(self, load: np.ndarray, period: float) -> None:
        """Replace the first loads by a push that carries the rotor through the slack.

        Under a load F for a time t_1, then coasting as long, the cable winds in
        F t_1^2 (1/2 + 1) / (J / r^2). The muscle's damping takes what speed is left.
        """
        if self.cable.slack == 0.0:
            return
        push = max(1, round(TAKE_UP_S / period))
        load[:push] = self.cable.slack * self.rotor_mass / (1.5 * (push * period) ** 2)
        load[push : 2 * push] = 0.0


class Muscle:
    """The muscle of a plant on its own, moved at will.

    Args:
        plant: the plant.
        rest: where it begins, at rest.
    """

    def __init__(self, plant: Plant, rest: Condition) -> None:
        self.plant = plant
        self.state = rest.state.copy()
        self.zero = rest.zero_contraction
        self.mass = plant.model.parameters["slide"].mass
        states = plant.states
        self._x, self._v = states.index("contraction"), states.index("velocity")
        effects = plant.model.effects
        # Memories of the way travelled are known exactly after it; the others have rates.
        self._paths = {
            states.index(f"memory_{name}"): (effect.path, plant.model.parameters[name])
            for name, effect in effects.items()
            if effect.path
        }
        memories = (i for i, name in enumerate(states) if name.startswith("memory_"))
        self._memories = [i for i in memories if i not in self._paths]

    def _rates(self) -> np.ndarray:
        # With the zero at the contraction itself the cable is exactly untensioned.
        return self.plant.derivative(self.state, 0.0, 0.0, float(self.state[self._x]))

    def tension(self, extension: float, speed: float) -> float:
        """Tension (N) that holds an extension (m) moving at a constant speed y' (m/s)."""
        self.state[self._x], self.state[self._v] = self.zero - extension, -speed
        return float(self.mass * self._rates()[self._v])

    def remember(self, extension: float, speed: float, duration: float) -> None:
        """Let the memories go on for a while (s) at an extension (m) and speed y' (m/s).

        Exponential Rosenbrock-Euler for those that have rates.
        """
        self.state[self._x], self.state[self._v] = self.zero - extension, -speed
        rates = self._rates()
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


class CascadeInverse:
    """Inverse of the dissertation's cascade; its motor, at 13 428 1/s, is taken as immediate.

    Args:
        plant: the nominal plant.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.parameters = plant.model.parameters

    def __call__(self, reference: Reference, station: Station, steps: int) -> np.ndarray:
        """Motor voltage (V) of every control period, shape (steps,), from its middle."""
        ends = np.array([reference(k * station.period) for k in range(steps + 1)])
        middle = np.array([reference((k + 0.5) * station.period) for k in range(steps)])
        if station.task.protocol.quantity == "rotation":
            return self._mapped(self.parameters["servo"].radius * middle, station.pressure)
        rate = np.diff(ends) / station.period
        # The muscle relaxes where the motor is ahead of it, as where y rises.
        relaxing, contracting = self._lag(station.pressure, 1), self._lag(station.pressure, -1)
        lag = np.where(rate >= 0.0, relaxing, contracting)
        return self._mapped(middle + lag * rate, station.pressure)

    def _lag(self, pressure: float, sign: int) -> float:
        """Time constant of the muscle (s) with the motor ahead of it (1) or behind (-1)."""
        state = self.plant.settle(0.0, pressure=pressure).state
        ahead, extension = sign * 1e-3, self.plant.states.index("extension")
        state[self.plant.states.index("servo")] = state[extension] + ahead
        return float(ahead / self.plant.derivative(state, 0.0, 0.0, 0.0)[extension])

    def _mapped(self, displacement: np.ndarray, pressure: float) -> np.ndarray:
        """Voltage of the static map at displacements (m); the edge of its dead zone at 0."""
        volts = np.linspace(0.0, VOLTAGE_LIMIT, 20001)
        reached = lanes(mapped_displacement)(volts, pressure, self.parameters["position_map"])
        first = max(0, int(np.argmax(reached > 0.0)) - 1)
        last = int(np.argmax(reached))
        return np.interp(displacement, reached[first : last + 1], volts[first : last + 1])
