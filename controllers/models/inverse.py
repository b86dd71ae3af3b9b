"""Inverse of a nominal model: the motor voltage that a motion needs.

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

The muscle of a nominal plant alone, at a prescribed motion; the inverses use it.
"""

import math
from typing import Protocol

import numpy as np

from controllers.models.voltage import VOLTAGE_LIMIT
from pma_gym.codegen.trace import as_numpy
from pma_gym.effects.drive.position_map import mapped_displacement
from pma_gym.envs import StationInfo
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.statics import Condition


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


PROBE_PA = 1e3
"""Change of pressure by which the force's slope is found (Pa)."""


class ContractionInverse:
    """Inverse of a station whose regulator contracts the muscle against a load.

    Args:
        plant: the nominal plant.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        parameters = plant.model.parameters
        rotor, self.drive = parameters["rotor"], parameters["drive"]
        self.line = parameters["regulator_line"]
        self.friction = rotor.damping / rotor.radius**2

    def parts(self, period: float) -> int:
        """Into how many steps a control period is divided: memories need short ones."""
        return max(1, math.ceil(period / 2e-3 - 1e-9))

    def along(self, target: np.ndarray, station: StationInfo) -> np.ndarray:
        """Regulator voltage (V) of every control period of a motion, shape (steps,)."""
        parts = self.parts(station.period)
        needed = self.pressures(target, station, station.period / parts)
        after, before = np.append(needed, needed[-1])[::parts], needed[parts - 1 :: parts]
        # Where a speed changes at a period's end, so does the pressure: by half before it.
        ends = np.append(station.pressure, 0.5 * (before + after[1:]))
        ends[: round(station.action_delay / station.period) + 1] = station.pressure
        start, change = ends[:-1], np.diff(ends)
        pace = np.where(change >= 0.0, *(self._pace(station.pressure, sign) for sign in (1, -1)))
        asked = start + change / -np.expm1(-pace * station.period)
        return (asked - self.line.offset) / self.line.gain

    def pressures(self, target: np.ndarray, station: StationInfo, step: float) -> np.ndarray:
        """Pressure (Pa) in the middle of every step of a motion, shape (n,).

        Args:
            target: contraction from the start at the nodes (m), shape (n + 1,).
            station: its pressure at the start and its load.
            step: time between nodes (s).
        """
        muscle = Muscle(
            self.plant,
            self.plant.settle(
                (station.task.load - self.drive.offset) / self.drive.gain, pressure=station.pressure
            ),
        )
        begin = muscle.zero - float(muscle.state[self.plant.states.index("contraction")])
        pressures, pressure = [], station.pressure
        middles, speeds = 0.5 * (target[1:] + target[:-1]), np.diff(target) / step
        for contraction, speed in zip(middles.tolist(), speeds.tolist(), strict=True):
            motion = begin - contraction, -speed
            above = muscle.tension_at(pressure + PROBE_PA, *motion)
            here = muscle.tension_at(pressure, *motion)
            load = station.task.load + self.friction * speed
            # The force is close to linear in the pressure, which moves little in a step.
            pressure += (load - here) / (above - here) * PROBE_PA
            muscle.tension_at(pressure, *motion)
            muscle.remember(*motion, step)
            pressures.append(pressure)
        return np.array(pressures)

    def _pace(self, pressure: float, sign: int) -> float:
        """Rate (1/s) at which the pressure follows a command above (1) or below it (-1)."""
        rest = self.plant.settle(0.0, pressure=pressure)
        away = sign * PROBE_PA
        rates = self.plant.derivative(
            rest.state,
            0.0,
            (pressure + away - self.line.offset) / self.line.gain,
            rest.zero_contraction,
        )
        return float(rates[self.plant.states.index("pressure")]) / away


STEP_S = 2e-3
"""Longest step along the reference (s); memories are exact to second order in it."""

TAKE_UP_S = 20e-3
"""For how long the rotor is pushed through the slack (s); it then coasts as long again."""


class Inverse(Protocol):
    """Inverse of a nominal model."""

    def parts(self, period: float) -> int:
        """Into how many steps a control period (s) is divided."""
        ...

    def along(self, target: np.ndarray, station: StationInfo) -> np.ndarray:
        """Voltage (V) of every control period of a motion.

        Args:
            target: positions (m or rad) at the ends of all parts, shape (steps * parts + 1,).
            station: task, pressure, control period, action delay.
        Returns:
            Shape (steps,). Not held to 0-10 V: beyond says by how much the motion asks for what
            the actuator cannot give.
        """
        ...


def inverse_of(model: Model, actuator: str = "motor") -> Inverse:
    """The inverse of a nominal model from the voltage of an actuator, `motor` or `regulator`."""
    plant = Plant(model)
    if actuator == "regulator":
        return ContractionInverse(plant)
    return StationInverse(plant) if model.rig.balances_loads else CascadeInverse(plant)


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

    def parts(self, period: float) -> int:
        """Into how many steps a control period (s) is divided."""
        return max(1, math.ceil(period / STEP_S - 1e-9))

    def along(self, target: np.ndarray, station: StationInfo) -> np.ndarray:
        """Motor voltage (V) of every control period of a motion, shape (steps,)."""
        parts = self.parts(station.period)
        rotation = station.task.schedule.followed.is_angle
        tension, extension = self.follow(target, station.period / parts, station.pressure, rotation)
        wound = self.rotor.radius * target if rotation else extension
        load = self._mean_load(tension, extension, wound, station.period, parts)
        if not rotation:
            self._take_up_slack(load, station)
        return (load - self.drive.offset) / self.drive.gain

    def follow(
        self, path: np.ndarray, step: float, pressure: float, rotation: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tension and extension along a motion.

        Args:
            path: extension (m) or rotation (rad) at the nodes, shape (n + 1,).
            step: time between nodes (s).
            pressure: gauge pressure (Pa).
            rotation: whether `path` is one.
        Returns:
            Tension without inertia in the steps (N), shape (n,), negative where the cable would
            have to push; extension at the nodes (m), shape (n + 1,).
        """
        muscle = Muscle(self.plant, self.plant.settle(0.0, pressure=pressure))
        tension, extension = np.zeros(len(path) - 1), np.zeros(len(path))
        for i in range(len(tension)):
            start, target = extension[i], path[i + 1]
            if rotation:
                target = self._pulled_to(self.rotor.radius * target, muscle, start, step)
            pull = muscle.tension(0.5 * (target + start), (target - start) / step)
            if pull < 0.0:
                # The cable cannot push: it hangs loose, and the muscle goes back as it does alone.
                start_tension = muscle.tension(start, 0.0)
                target = start + (target - start) * max(start_tension, 0.0) / (
                    max(start_tension, 0.0) - pull
                )
            muscle.remember(0.5 * (target + start), (target - start) / step, step)
            tension[i], extension[i + 1] = pull, target
        return tension, extension

    def _pulled_to(self, wound: float, muscle: Muscle, start: float, step: float) -> float:
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

    def _take_up_slack(self, load: np.ndarray, station: StationInfo) -> None:
        """Replace the first loads in force by a push that carries the rotor through the slack.

        Under a load F for a time t_1, then coasting as long, the cable winds in
        F t_1^2 (1/2 + 1) / (J / r^2). The muscle's damping takes what speed is left.
        """
        if self.cable.slack == 0.0:
            return
        period, first = station.period, round(station.action_delay / station.period)
        push = max(1, round(TAKE_UP_S / period))
        pushed, coasting = first + push, first + 2 * push
        load[first:pushed] = self.cable.slack * self.rotor_mass / (1.5 * (push * period) ** 2)
        load[pushed:coasting] = 0.0


class CascadeInverse:
    """Inverse of the dissertation's cascade; its motor, at 13 428 1/s, is taken as immediate.

    Args:
        plant: the nominal plant.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.parameters = plant.model.parameters

    def parts(self, period: float) -> int:
        """Into how many steps a control period is divided: its middle is asked for."""
        return 2

    def along(self, target: np.ndarray, station: StationInfo) -> np.ndarray:
        """Motor voltage (V) of every control period of a motion, from its middle."""
        ends, middle = target[::2], target[1::2]
        if station.task.schedule.followed.is_angle:
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
        reached = as_numpy(mapped_displacement)(volts, pressure, self.parameters["position_map"])
        first = max(0, int(np.argmax(reached > 0.0)) - 1)
        last = int(np.argmax(reached))
        return np.interp(displacement, reached[first : last + 1], volts[first : last + 1])
