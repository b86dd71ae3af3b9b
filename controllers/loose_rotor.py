"""The rotor while the cable hangs loose: nothing but the drive turns it, and nothing holds it.

    J theta'' = r g (V - V_idle + d) - B_M theta',   the pull V - V_idle + d not below 0

V_idle is the voltage at which the nominal drive begins to pull, d what is not known of it. A pull
cannot be taken back: the drive does not push. What a voltage under V_idle - d does is known
exactly, nothing; so d is learned only while the rotor is pulled.
"""

import numpy as np

from controllers.linear_motion import LinearMotion
from pma_gym.envs import Reading, Station
from pma_gym.plant import sensors

OFFSET, OFFSET_WANDER = 0.05, 0.01
"""Standard deviation of d before a trial and of its change over a second (V)."""

SHAKE = 0.01
"""Standard deviation of what the drive gives beside its line for a period (V)."""

RELEASED = np.radians([0.1, 10.0])
"""Standard deviations of angle (rad) and rate (rad/s) as the cable lets go."""


class LooseRotor:
    """Estimates angle and rate of a free rotor and the drive's offset, and foresees them.

    Args:
        motion: the nominal motion.
        station: model, control period.

    Attributes:
        state: angle (rad), rate (rad/s), d (V).
    """

    def __init__(self, motion: LinearMotion, station: Station) -> None:
        rotor, drive = (station.model.parameters[name] for name in ("rotor", "drive"))
        period, self._idle = station.period, motion.idle
        self._pace = drive.gain * rotor.radius / rotor.inertia
        slowed = np.exp(-rotor.damping / rotor.inertia * period)
        self._step = np.array([[1.0, period, 0.0], [0.0, slowed, 0.0], [0.0, 0.0, 1.0]])
        self._pulled = self._pace * np.array([0.5 * period**2, period, 0.0])
        self._wander = np.diag([0.0, 0.0, OFFSET_WANDER**2 * period])
        at = list(sensors.SENSORS).index("potentiometer")
        rounding = sensors.SENSORS["potentiometer"][1].resolution / np.sqrt(12.0)
        self._noise = float(sensors.noise_levels(station.model)[at] ** 2 + rounding**2)
        self.state = np.zeros(3)
        self._covariance = np.diag([0.0, 0.0, OFFSET**2])

    def release(self, angle: float, rate: float) -> None:
        """Begin where the cable lets go; the offset stays as it is known."""
        self.state[:2] = angle, rate
        kept = self._covariance[2, 2]
        self._covariance = np.diag([*np.square(RELEASED), kept])

    def moved(self, state: np.ndarray, volts: float) -> np.ndarray:
        """State a period later, with a voltage in force (V)."""
        return self._step @ state + self._pulled * max(volts - self._idle + state[2], 0.0)

    def pass_period(self, volts: float) -> None:
        """Let a period pass in which a voltage (V) was in force."""
        pulls = volts - self._idle + self.state[2] > 0.0
        slope = self._step.copy()
        slope[:, 2] += pulls * self._pulled
        shaken = SHAKE * pulls * self._pulled
        self.state = self.moved(self.state, volts)
        self._covariance = slope @ self._covariance @ slope.T + self._wander
        self._covariance += np.outer(shaken, shaken)

    def see(self, angle: float) -> None:
        """Take in the angle that the potentiometer says (rad)."""
        shared = self._covariance[:, 0]
        gain = shared / (shared[0] + self._noise)
        self.state = self.state + gain * (angle - self.state[0])
        self._covariance = self._covariance - np.outer(gain, shared)

    def outlook(self, state: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Angles (rad) at the ends of the coming periods without a pull, and by pulls.

        Returns:
            Angles, shape (count,), and what each gains by a volt of pull in each, shape
            (count, count).
        """
        ahead, rows = state.copy(), []
        ahead[2] = 0.0
        for _ in range(count):
            ahead = self._step @ ahead
            rows.append(ahead[0])
        turned, gained = self._pulled.copy(), []
        for _ in range(count):
            gained.append(turned[0])
            turned = self._step @ turned
        late = np.subtract.outer(np.arange(count), np.arange(count))
        return np.array(rows), np.where(late >= 0, np.array(gained)[np.maximum(late, 0)], 0.0)
