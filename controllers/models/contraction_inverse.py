"""Inverse of a nominal station moved by the regulator: the voltage that a contraction needs.

The motor holds a load L. What the muscle must give along the contraction x says which pressure it
needs, and the regulator's lag which pressure must be asked for:

    F(P, x, memories) = L + (B + B_M / r^2) x'
    P_command = P + (P_end - P) / (1 - exp(-T / tau)) over a control period T

The second is exact for a command held over the period: the pressure then ends it where the motion
needs it. The slide's and the rotor's inertia (3.5 kg at a change of speed of 10 mm/s: 3.5 N over
10 ms) are left out.
"""

import math

import numpy as np

from controllers.models.muscle import Muscle
from pma_gym.envs import StationInfo
from pma_gym.plant.plant import Plant

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

    def along(self, wanted: np.ndarray, station: StationInfo) -> np.ndarray:
        """Regulator voltage (V) of every control period of a motion, shape (steps,)."""
        parts = self.parts(station.period)
        needed = self.pressures(wanted, station, station.period / parts)
        after, before = np.append(needed, needed[-1])[::parts], needed[parts - 1 :: parts]
        # Where a speed changes at a period's end, so does the pressure: by half before it.
        ends = np.append(station.pressure, 0.5 * (before + after[1:]))
        ends[: round(station.action_delay / station.period) + 1] = station.pressure
        start, change = ends[:-1], np.diff(ends)
        pace = np.where(change >= 0.0, *(self._pace(station.pressure, sign) for sign in (1, -1)))
        asked = start + change / -np.expm1(-pace * station.period)
        return (asked - self.line.offset) / self.line.gain

    def pressures(self, wanted: np.ndarray, station: StationInfo, step: float) -> np.ndarray:
        """Pressure (Pa) in the middle of every step of a motion, shape (n,).

        Args:
            wanted: contraction from the start at the nodes (m), shape (n + 1,).
            station: its pressure at the start and its load.
            step: time between nodes (s).
        """
        motor = (station.task.load - self.drive.offset) / self.drive.gain
        muscle = Muscle(self.plant, self.plant.settle(motor, pressure=station.pressure))
        begin = muscle.zero - float(muscle.state[self.plant.states.index("contraction")])
        pressures, pressure = [], station.pressure
        middles, speeds = 0.5 * (wanted[1:] + wanted[:-1]), np.diff(wanted) / step
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
        volts = (pressure + away - self.line.offset) / self.line.gain
        rates = self.plant.derivative(rest.state, 0.0, volts, rest.zero_contraction)
        return float(rates[self.plant.states.index("pressure")]) / away
